"""Arc length along a branch of equilibria: points and steps where λ is an unknown too.

Where a stable branch has ended the path parameter may turn back, or stand still while the structure moves:
each step prescribes the distance along the branch instead, (P6) (Riks 1979, Crisfield 1981), measured in the
positions relative to the structure's size and in λ.
"""

from dataclasses import dataclass

import numpy as np

from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.inputs import Load, StageInputs
from tensegra.mechanics.law import plain
from tensegra.mechanics.tangent import Tangent

MOST_CORRECTIONS = 10
"""Newton solves of one point after which a step is cut."""


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A point of the branch: λ, positions, the unit tangent (∂x/∂s, ∂λ/∂s) and the inertia of K."""

    parameter: float
    nodes: FloatArray
    motion: FloatArray
    rate: float
    n_negative: int
    iterations: int = 0


@dataclass(eq=False)
class Branch:
    """A branch of equilibria of one run.

    Attributes
    ----------
    tangent
        Of the structure, with coordinates held for its neutral motions.
    stage, stiffness
        Inputs along the stage and EA, of the run alone.
    tolerance
        Relative residual at which a point is one.
    """

    tangent: Tangent
    stage: StageInputs
    stiffness: FloatArray
    tolerance: float

    def load_at(self, parameter: float) -> Load:
        """Return what acts at λ."""
        return Load(
            self.stage.rest_length_at(parameter),
            self.stiffness,
            self.stage.loads_at(parameter),
            self.tolerance,
        )

    def with_supports(self, nodes: FloatArray, parameter: float) -> FloatArray:
        """Return `nodes` with the held coordinates where the supports are at λ."""
        return np.where(self.tangent.given.free, nodes, self.stage.positions_at(parameter))

    def velocity(self, parameter: float) -> tuple[FloatArray, FloatArray]:
        """Return dx/dλ and dT/dλ at the point last measured and factorised."""
        stage, tangent = self.stage, self.tangent
        held = np.where(tangent.given.free, 0.0, stage.positions_end - stage.positions_start)
        rest_length = stage.rest_length_at(parameter)
        by_length = plain.by_rest_length(tangent.length, rest_length, self.stiffness)
        tension_rate = tangent.taut * by_length * stage.rest_length_rate(parameter)
        force_rate = tangent.force_rate(held, tension_rate) - (stage.loads_end - stage.loads_start)
        velocity = tangent.solve(-force_rate) + held
        return velocity, tangent.axial * tangent.length_rate(velocity) + tension_rate

    def point(
        self,
        nodes: FloatArray,
        parameter: float,
        before: BranchPoint | None = None,
        iterations: int = 0,
    ) -> BranchPoint:
        """Measure a point of the branch and orient its tangent like the one before it, else by λ."""
        size = self.tangent.arrays.size
        self.tangent.measure(nodes, self.load_at(parameter))
        n_negative = self.tangent.factorise()
        velocity, _ = self.velocity(parameter)
        norm = float(np.sqrt(np.sum((velocity / size) ** 2) + 1.0))
        motion, rate = velocity / norm, 1.0 / norm
        if before is not None and np.sum(motion * before.motion) / size**2 + rate * before.rate < 0.0:
            motion, rate = -motion, -rate
        return BranchPoint(parameter, nodes, motion, rate, n_negative, iterations)

    def step(self, here: BranchPoint, arc: float) -> BranchPoint | None:
        """Take a step of length `arc`; None where the corrector does not converge."""
        tangent, size = self.tangent, self.tangent.arrays.size
        x, parameter = here.nodes + arc * here.motion, here.parameter + arc * here.rate
        tension: FloatArray | None = None
        last_move = np.inf
        for iteration in range(MOST_CORRECTIONS):
            load = self.load_at(parameter)
            x = self.with_supports(x, parameter)
            out, residual = tangent.measure(x, load, tension)
            if residual <= self.tolerance and tangent.measure(x, load)[1] <= self.tolerance:
                turned = (
                    np.sum((x - here.nodes) * here.motion) / size**2
                    + (parameter - here.parameter) * here.rate
                )
                return self.point(x, parameter, here, iteration) if turned > 0.0 else None
            tangent.factorise()
            velocity, tension_rate = self.velocity(parameter)
            correction = tangent.solve(-out)
            ahead = np.sum((x + correction - here.nodes) * here.motion) / size**2
            ahead += (parameter - here.parameter) * here.rate - arc
            slope = np.sum(velocity * here.motion) / size**2 + here.rate
            change = -ahead / slope
            move = correction + change * velocity
            size_of_move = float(np.abs(move).max() / size + abs(change))
            if not size_of_move < 5.0 * arc or (iteration > 1 and size_of_move > 0.7 * last_move):
                return None
            tension = predicted_tension(tangent, load, correction) + change * tension_rate
            x, parameter, last_move = x + move, parameter + change, size_of_move
        return None


def predicted_tension(tangent: Tangent, load: Load, correction: FloatArray) -> FloatArray:
    """Return the tensions k (ℓ − l₀ + b·u) after a correction u of the nodes, were all members taut."""
    along = plain.by_length(tangent.length, load.rest_length, load.stiffness) * tangent.length_rate(
        correction
    )
    tension: FloatArray = plain.tension(tangent.length, load.rest_length, load.stiffness) + along
    return tension
