"""A path follower of a hundred lines, dense and slow, that shares nothing with the package's own.

It walks an actuation in steps so small that a leap cannot hide in one: a point is accepted only if it is
an equilibrium, K is positive definite there, and it lies within `NEAR` of the tangent line of the point
before; a step over a change between slack and taut may not move the structure by more than that at all.
Where no step is small enough the branch has ended, and a fall along the energy tells how far.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

BALANCED = 1e-10
"""Largest force out of balance, of the largest tension or load: a tenth of what the package promises."""

ROUNDING = 64 * np.finfo(float).eps
"""Of EA: forces below this are what rounding of the coordinates makes of nothing."""

NEAR = 2e-5
"""Of the size: a fifth of the shortest leap that counts as a snap."""

LARGEST_STEP = 1e-2
"""Of the way."""

LARGEST_MOVE = 5e-3
"""Of the size, along the tangent: a curve of the structure's own size is left by half its square, 1e-5."""

SMALLEST_STEP = 1e-12
"""Of the way: at a fold the branch moves as the root of what is left, 1e-6 of the size."""

BEYOND = 1e-9
"""Of the way: how far behind the end of a branch the fall begins; the branch moves by its root, 3e-5."""

SNAP = 1e-4
"""Of the size: a fall that moves no node as far has not left the branch."""

DOUBT = 4.0
"""Leaps within this factor of `SNAP` are neither."""

FALLEN = 1e-2
"""Of the size: a fall is not followed farther, for it has told enough."""

SINGULAR = 1e-11
"""Of the largest entry of K: eigenvalues below are nothing."""


class Model:
    """A structure in flat arrays, with its energy, forces and stiffness; supports stay where they are."""

    def __init__(self, structure):
        ids = list(structure.nodes)
        segments = [
            (e, ids.index(i), ids.index(j))
            for e, member in enumerate(structure.members.values())
            for i, j in pairwise(member.nodes)
        ]
        self.owner, first, second = np.array(segments).T
        self.coordinates = np.array(structure.coordinates)
        self.size = np.ptp(self.coordinates, axis=0).max()
        self.free = np.array(
            [[axis not in structure.supports.get(node, "") for axis in "xyz"] for node in ids]
        )
        self.incidence = np.zeros((len(segments), len(ids)))
        self.incidence[np.arange(len(segments)), first] = -1.0
        self.incidence[np.arange(len(segments)), second] = 1.0
        self.membership = np.zeros((structure.n_members, len(segments)))
        self.membership[self.owner, np.arange(len(segments))] = 1.0
        self.stiffness = np.array([structure.axial_stiffness(name) for name in structure.members])
        self.is_cable = np.array([member.is_cable for member in structure.members.values()])
        length = np.linalg.norm(self.incidence @ self.coordinates, axis=1)
        per_length = np.array([structure.weight_per_length(name) for name in structure.members])
        self.weight = 0.5 * np.abs(self.incidence).T @ (per_length[self.owner] * length)

    def inputs_after_stages(self, structure):
        """Return rest lengths, ``(n_members,)``, and nodal forces, ``(n_nodes, 3)``."""
        names, ids = list(structure.members), list(structure.nodes)
        rest_length = np.array([member.rest_length for member in structure.members.values()])
        loads, gravity = np.zeros_like(self.coordinates), np.array(structure.gravity)
        for stage in structure.stages:
            assert not stage.temperatures
            assert not stage.positions
            for name, change in stage.rest_length_changes.items():
                rest_length[names.index(name)] *= 1.0 + change
            for name, value in stage.rest_lengths.items():
                rest_length[names.index(name)] = value
            for node, force in stage.loads.items():
                loads[ids.index(node)] = force
            gravity = gravity if stage.gravity is None else np.array(stage.gravity)
        return rest_length, loads + self.weight[:, None] * gravity

    def tensions(self, x, rest_length):
        """Return the tension of each member and whether it carries any, both ``(n_members,)``."""
        length = self.membership @ np.linalg.norm(self.incidence @ x, axis=1)
        tension = self.stiffness * (length / rest_length - 1.0)
        taut = ~self.is_cable | (tension > 0.0)
        return np.where(taut, tension, 0.0), taut

    def energy(self, x, rest_length, loads):
        """Return the potential energy Π = Σ ½ T² l₀/EA − p·x."""
        tension, _ = self.tensions(x, rest_length)
        return float(np.sum(0.5 * tension**2 * rest_length / self.stiffness) - np.sum(loads * x))

    def rates(self, x):
        """Return b = ∂ℓ/∂x of each member, ``(n_members, 3 n_nodes)``."""
        span = self.incidence @ x
        unit = span / np.linalg.norm(span, axis=1)[:, None]
        rate = self.membership @ (self.incidence[:, :, None] * unit[:, None, :]).reshape(len(span), -1)
        return rate.reshape(len(self.stiffness), -1)

    def out_of_balance(self, x, rest_length, loads):
        """Return f − p, ``(n_nodes, 3)``: at the supports it is the reaction."""
        tension, _ = self.tensions(x, rest_length)
        return (tension @ self.rates(x)).reshape(-1, 3) - loads

    def stiffness_matrix(self, x, rest_length):
        """Return K over the free coordinates."""
        tension, taut = self.tensions(x, rest_length)
        span = self.incidence @ x
        length = np.linalg.norm(span, axis=1)
        unit = span / length[:, None]
        rate = self.rates(x)
        K = rate.T @ (np.where(taut, self.stiffness / rest_length, 0.0)[:, None] * rate)
        pull = (tension[self.owner] / length)[:, None, None] * (
            np.eye(3) - unit[:, :, None] * unit[:, None, :]
        )
        K = K.reshape(len(x), 3, len(x), 3)
        for i in range(3):
            for j in range(3):
                K[:, i, :, j] += self.incidence.T @ (pull[:, i, j, None] * self.incidence)
        free = self.free.ravel()
        return K.reshape(3 * len(x), 3 * len(x))[np.ix_(free, free)]

    def lowest_eigenvalue(self, x, rest_length):
        """Return the lowest eigenvalue of K."""
        return float(np.linalg.eigvalsh(self.stiffness_matrix(x, rest_length))[0])

    def force_scale(self, x, rest_length, loads):
        """Return what a force out of balance is compared with."""
        tension, _ = self.tensions(x, rest_length)
        return max(np.abs(tension).max(), np.abs(loads).max(), ROUNDING / BALANCED * self.stiffness.max())

    def is_positive_definite(self, K):
        """Tell whether the lowest eigenvalue is clearly above nothing."""
        try:
            np.linalg.cholesky(K - SINGULAR * np.abs(K).max() * np.eye(len(K)))
        except np.linalg.LinAlgError:
            return False
        return True


@dataclass(frozen=True)
class Walk:
    """Where a walk came to.

    Attributes
    ----------
    falls
        Where on the way the branch ended, and the largest distance that a node leapt there, of the size:
        infinite where no place was found within `FALLEN`, which ended the walk.
    nodes
        At the end of the way, or before the leap that ended the walk.
    """

    falls: tuple[tuple[float, float], ...]
    nodes: np.ndarray

    @property
    def is_continuous(self):
        """Whether nothing leapt."""
        return all(distance < SNAP / DOUBT for _, distance in self.falls)

    @property
    def leaps(self):
        """Where something leapt beyond doubt."""
        return [parameter for parameter, distance in self.falls if distance > SNAP * DOUBT]


class Walker:
    """Walks the actuation of a structure from an equilibrium.

    Parameters
    ----------
    structure
        The structure.
    actuation
        Value of each actuator at the end of the way.
    loads
        Forces by (node, axis) that are added along the way.
    """

    def __init__(self, structure, actuation, loads=None):
        self.model = Model(structure)
        self.rest_length, self.loads = self.model.inputs_after_stages(structure)
        self.rates = []  # of the factor on the rest lengths, for each actuator
        names, ids = list(structure.members), list(structure.nodes)
        for name, value in actuation.items():
            actuator = structure.actuators[name]
            rate = np.zeros(len(names))
            members = [m for given in actuator.members for m in structure.members_named(given)]
            rate[[names.index(m) for m in members]] = actuator.factor(value) - 1.0
            self.rates.append(rate)
        self.added = np.zeros_like(self.loads)
        for (node, axis), force in (loads or {}).items():
            self.added[ids.index(node), "xyz".index(axis)] += force

    def inputs(self, parameter):
        """Return rest lengths and loads on the way."""
        factors = [1.0 + parameter * rate for rate in self.rates]
        return self.rest_length * np.prod(factors, axis=0), self.loads + parameter * self.added

    def walk(self, nodes):
        """Walk from the equilibrium `nodes` to the end of the way or to the first leap beyond `FALLEN`."""
        x, here, step, falls = np.array(nodes), 0.0, LARGEST_STEP, []
        while here < 1.0:
            if step < SMALLEST_STEP:
                fallen, distance = self.fall(x, min(1.0, here + BEYOND))
                falls.append((here, distance))
                if fallen is None:
                    break
                x, here, step = fallen, min(1.0, here + BEYOND), BEYOND
                continue
            there = here + step if 1.0 - here - step > SMALLEST_STEP else 1.0
            found = self.step(x, here, there)
            if found is None:
                step *= 0.4
            else:
                x, here, step = found, there, min(2.0 * step, LARGEST_STEP)
        return Walk(tuple(falls), x)

    def velocity(self, x, parameter):
        """Return dx/dλ of the free coordinates."""
        model, small = self.model, 1e-6
        (l0, p), (more, q) = self.inputs(parameter), self.inputs(parameter + small)
        rest_rate, load_rate = (more - l0) / small, (q - p) / small
        tension, taut = model.tensions(x, l0)
        change = np.where(taut, -(model.stiffness + tension) / l0 * rest_rate, 0.0)
        force_rate = (change @ model.rates(x)).reshape(-1, 3) - load_rate
        return np.linalg.solve(model.stiffness_matrix(x, l0), -force_rate[model.free])

    def step(self, x, here, there):
        """Return the equilibrium at `there` if it belongs to the branch; None if that is not sure."""
        model = self.model
        _, taut = model.tensions(x, self.inputs(here)[0])
        move = (there - here) * self.velocity(x, here)
        if np.abs(move).max(initial=0.0) > LARGEST_MOVE * model.size:
            return None
        guess = x.copy()
        guess[model.free] += move
        found = self.correct(guess, there)
        if found is None or np.abs(found - guess).max() > NEAR * model.size:
            return None
        rest_length, _ = self.inputs(there)
        changed = np.any(model.tensions(found, rest_length)[1] != taut)
        if changed and np.abs(found - x).max() > NEAR * model.size:
            return None
        return found if model.is_positive_definite(model.stiffness_matrix(found, rest_length)) else None

    def correct(self, x, parameter, iterations=12):
        """Return the equilibrium that Newton's method finds from `x`, or None."""
        model, (rest_length, loads) = self.model, self.inputs(parameter)
        x = x.copy()
        for _ in range(iterations):
            out = model.out_of_balance(x, rest_length, loads)[model.free]
            if np.abs(out).max(initial=0.0) <= BALANCED * model.force_scale(x, rest_length, loads):
                return x
            try:
                correction = np.linalg.solve(model.stiffness_matrix(x, rest_length), -out)
            except np.linalg.LinAlgError:
                return None
            if not np.all(np.isfinite(correction)) or np.abs(correction).max() > 0.1 * model.size:
                return None
            x[model.free] += correction
        return None

    def fall(self, nodes, parameter):
        """Go down the energy from `nodes`; return the place and how far a node moved, of the size.

        Newton's method with K shifted to be positive definite, in steps that lower the energy. The place
        is None where none was found within `FALLEN`.
        """
        model, (rest_length, loads) = self.model, self.inputs(parameter)
        x = np.array(nodes)
        for _ in range(2000):
            out = model.out_of_balance(x, rest_length, loads)[model.free]
            K = model.stiffness_matrix(x, rest_length)
            values, vectors = np.linalg.eigh(K)
            distance = float(np.linalg.norm(x - nodes, axis=1).max() / model.size)
            if distance > FALLEN:
                return None, np.inf
            balanced = np.abs(out).max() <= BALANCED * model.force_scale(x, rest_length, loads)
            if balanced and values[0] > SINGULAR * np.abs(K).max():
                return x, distance
            floor = 1e-9 * np.abs(K).max()
            move = -vectors @ ((vectors.T @ out) / np.maximum(np.abs(values), floor))
            if balanced:
                move = vectors[:, 0] * 1e-6 * model.size
            move *= min(1.0, 1e-3 * model.size / np.abs(move).max())
            before = model.energy(x, rest_length, loads)
            while np.abs(move).max() > 1e-14 * model.size:
                trial = x.copy()
                trial[model.free] += move
                if model.energy(trial, rest_length, loads) <= before:
                    break
                move *= 0.4
            else:
                return self.near(nodes, x, parameter)  # the energy has no digits left to go down by
            x = trial
        return self.near(nodes, x, parameter)

    def near(self, nodes, x, parameter):
        """Return the stable equilibrium beside `x` and how far it is from `nodes`, as `fall` does."""
        found = self.correct(x, parameter)
        if found is None or np.abs(found - x).max() > NEAR * self.model.size:
            return None, np.inf
        if not self.model.is_positive_definite(self.model.stiffness_matrix(found, self.inputs(parameter)[0])):
            return None, np.inf
        return found, float(np.linalg.norm(found - nodes, axis=1).max() / self.model.size)
