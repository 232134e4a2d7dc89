"""What an analysis returns: equilibria that carry their proof, paths that tell what happened."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tensegra.errors import SolverError
from tensegra.mechanics.arrays import AXES, BoolArray, FloatArray, StructureArrays
from tensegra.mechanics.derivatives import (
    Derivative,
    Given,
    ParameterKind,
    differentiate,
    direction_of,
    settle_tangent,
)
from tensegra.mechanics.history import history_arrays
from tensegra.mechanics.inputs import Load
from tensegra.mechanics.reactions import reactions
from tensegra.mechanics.rigid import Freedom, in_frame
from tensegra.mechanics.status import (
    CriticalPoint,
    PathPoint,
    SlackEvent,
    Status,
    axis_index,
    index_of,
    names_in,
)
from tensegra.mechanics.strains import strain_warning
from tensegra.mechanics.tangent import Tangent
from tensegra.presented import Presented
from tensegra.savable import Savable
from tensegra.structure import Structure
from tensegra.viewable import Viewable

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(Presented):
    """One equilibrium and its certificate.

    Attributes
    ----------
    structure
        The structure whose equilibrium it is.
    stage
        Name of the stage that ends in it.
    status, reason
        What is known of it; the reason is empty where the status is ``stable``.
    nodes
        Positions, shape ``(n_nodes, 3)``, unit of length; NaN where failed.
    tensions
        Tension positive, shape ``(n_members,)``, unit of force; zero for slack cables.
    slack
        True for a cable that carries nothing, shape ``(n_members,)``.
    residual
        ‖f − p‖∞ relative to the largest tension or load.
    lowest_eigenvalue
        Of the tangent stiffness K over the free coordinates, force per length.
    n_negative
        Number of eigenvalues of K that are not positive (its inertia).
    strain_energy
        Σ T (ℓ − l₀)/2, force times length.
    steps, iterations
        Increments and Newton solves that led to it, within its stage.
    parameter
        Path parameter in [0, 1] within its stage at which it stands, 1 at the end.
    forces
        Nodal forces that act there, weight included, shape ``(n_nodes, 3)``.
    arrays
        The structure as arrays.
    mechanisms
        For a collapse, the nodes that each free mechanism moves most.
    rigid_motions
        Rigid motions that neither supports nor loads hold: the position along them is free. It is given
        where the mean square of the distances from where the stage began is least.
    """

    structure: Structure = field(repr=False)
    stage: str
    status: Status
    reason: str
    nodes: FloatArray = field(repr=False)
    tensions: FloatArray = field(repr=False)
    slack: BoolArray = field(repr=False)
    residual: float
    lowest_eigenvalue: float
    n_negative: int
    strain_energy: float
    steps: int
    iterations: int
    parameter: float
    forces: FloatArray = field(repr=False)
    arrays: StructureArrays = field(repr=False)
    mechanisms: tuple[tuple[str, ...], ...] = ()
    rigid_motions: tuple[str, ...] = ()

    @property
    def succeeded(self) -> bool:
        """Whether it is a stable equilibrium."""
        return self.status in (Status.STABLE, Status.SNAPPED)

    def raise_for_status(self) -> Self:
        """Return itself, or raise `SolverError` where it is not a stable equilibrium."""
        if not self.succeeded:
            raise SolverError(f"stage '{self.stage}' is {self.status}: {self.reason}")
        return self

    def node(self, node: str | int) -> FloatArray:
        """Position of a node, shape ``(3,)``."""
        return np.array(self.nodes[index_of(self.structure.nodes, node, "node")])

    def tension(self, member: str | int) -> float:
        """Tension of a member, unit of force."""
        return float(self.tensions[index_of(self.structure.members, member, "member")])

    @property
    def strains(self) -> FloatArray:
        """Strain T/EA of each member, tension positive, shape ``(n_members,)``; zero for slack cables."""
        return self.tensions / self.arrays.stiffness

    @property
    def largest_strain(self) -> float:
        """Largest strain of a member in magnitude; NaN where failed."""
        return float(np.abs(self.strains).max())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the equilibrium doubtful although it is one, in sentences: strains beyond the law."""
        found = strain_warning(self.structure, self.strains)
        return (found,) if found else ()

    @cached_property
    def reactions(self) -> FloatArray:
        """Forces of the supports on the structure, ``(n_nodes, 3)``; zero where nothing holds.

        Together with `forces` they sum to zero, and so do their moments. NaN where failed.
        """
        return reactions(self.arrays, self.nodes, self.tensions, self.forces)

    @property
    def utilisation(self) -> dict[str, float]:
        """Force of each member as a share of what it may carry.

        For a strut with a section inertia I, compression over Euler's load π² E I/l₀² of a bar
        hinged at both ends; for a member with a strength, tension over it. One is the limit. Members
        with neither are left out.
        """
        shares = {}
        for (name, member), force in zip(self.structure.members.items(), self.tensions, strict=True):
            if member.section_inertia is not None and member.material is not None:
                modulus = self.structure.materials[member.material].youngs_modulus
                euler = np.pi**2 * modulus * member.section_inertia / member.rest_length**2
                shares[name] = max(0.0, -float(force)) / euler
            if member.strength is not None:
                shares[name] = max(shares.get(name, 0.0), abs(float(force)) / member.strength)
        return shares

    @property
    def slack_members(self) -> tuple[str, ...]:
        """Names of the slack cables."""
        return tuple(np.array(list(self.structure.members), dtype=object)[self.slack])

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values, as `tensegra solve --json` prints them; null where failed."""
        failed = self.status is Status.FAILED
        return {
            "name": self.stage,
            "status": str(self.status),
            "reason": self.reason,
            "nodes": None if failed else dict(zip(self.structure.nodes, self.nodes.tolist(), strict=True)),
            "tensions": None
            if failed
            else dict(zip(self.structure.members, self.tensions.tolist(), strict=True)),
            "reactions": None if failed else self._reactions_by_node(),
            "slack": None if failed else list(self.slack_members),
            "residual": _finite(self.residual),
            "lowest_eigenvalue": _finite(self.lowest_eigenvalue),
            "negative_eigenvalues": self.n_negative,
            "strain_energy": _finite(self.strain_energy),
            "steps": self.steps,
            "iterations": self.iterations,
            "mechanisms": [list(nodes) for nodes in self.mechanisms],
            "rigid_motions": list(self.rigid_motions),
            "utilisation": {} if failed else self.utilisation,
            "largest_strain": _finite(self.largest_strain),
            "warnings": list(self.warnings),
        }

    def to_dataframe(self) -> "pd.DataFrame":
        """Return a row for each member: ``member``, ``kind``, ``tension`` (unit of force) and ``slack``."""
        import pandas as pd

        members = self.structure.members
        return pd.DataFrame(
            {
                "member": list(members),
                "kind": ["clustered cable" if m.is_clustered else m.kind for m in members.values()],
                "tension": self.tensions,
                "slack": self.slack,
            }
        )

    def __repr__(self) -> str:
        reason = f" ({self.reason})" if self.reason else ""
        slack = f"{len(self.slack_members)} of {self.structure.n_members} members slack"
        return (
            f"Equilibrium({self.structure.name!r}, {self.stage!r}: {self.status}{reason}; "
            f"residual {self.residual:.2g}, lowest eigenvalue {self.lowest_eigenvalue:.4g} "
            f"{self.structure.units.of('force per length')}, {slack})"
        )

    def _reactions_by_node(self) -> dict[str, list[float]]:
        """Return the reaction at each supported node, in the order of the nodes."""
        supported = np.flatnonzero(~self.arrays.free.all(axis=1))
        return {self.arrays.node_ids[n]: self.reactions[n].tolist() for n in supported}


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumPath(Presented, Savable, Viewable):
    """The equilibria of a loading history: those of the stages and of the actuation after them.

    Attributes
    ----------
    structure
        The structure.
    stages
        One equilibrium per stage of the structure, in order.
    actuation
        The equilibrium under actuation, temperature and the other inputs of the run; None where
        nothing acts after the stages.
    critical_points, slack_events
        What happened on the way, in order.
    history
        Every accepted step, in order.
    given, load, freedom
        The inputs at the last equilibrium, and the rigid motions that are neutral there, for its
        derivatives.
    """

    structure: Structure
    stages: tuple[Equilibrium, ...]
    actuation: Equilibrium | None
    given: Given = field(repr=False)
    load: Load = field(repr=False)
    freedom: Freedom = field(repr=False)
    critical_points: tuple[CriticalPoint, ...] = ()
    slack_events: tuple[SlackEvent, ...] = ()
    history: tuple[PathPoint, ...] = field(default=(), repr=False)

    @property
    def final(self) -> Equilibrium:
        """The last equilibrium of the history."""
        return self.stages[-1] if self.actuation is None else self.actuation

    @property
    def status(self) -> Status:
        """Status of the whole history: ``snapped`` where it left a branch anywhere on the way."""
        if self.final.status is Status.STABLE and any(
            stage.status is not Status.STABLE for stage in self.stages
        ):
            return Status.SNAPPED
        return self.final.status

    @property
    def reason(self) -> str:
        """Why the status is not ``stable``; empty where it is."""
        if self.status is Status.STABLE:
            return ""
        reasons = [e.reason for e in (*self.stages, self.actuation) if e is not None and e.reason]
        return "; ".join(reasons)

    @property
    def displacements(self) -> FloatArray:
        """Displacements by the actuation from the last stage, shape ``(n_nodes, 3)``."""
        return self.final.nodes - self.stages[-1].nodes

    def displacement(self, axis: str, nodes: str | int | Sequence[str | int]) -> float:
        """Mean displacement of the named nodes along an axis, from the last stage's equilibrium."""
        rows = [index_of(self.structure.nodes, node, "node") for node in names_in(nodes)]
        return float(self.displacements[rows, axis_index(axis)].mean())

    def derivative(self, name: object, of: ParameterKind = "actuation") -> Derivative:
        """Differentiate positions and tensions of the last equilibrium by one parameter, exactly.

        Parameters
        ----------
        name
            An actuator; or what `of` asks for: a member or group (temperature, area), a member
            (rest_length, stiffness), a material (youngs_modulus), a (node, axis) (load, position).
        of
            Kind of the parameter.

        Raises
        ------
        ModelError
            For a name that the structure does not have.
        SolverError
            Where the last equilibrium is not a stable one.

        Examples
        --------
        >>> from tensegra.mechanics import solve_path
        >>> from tensegra.structure import library
        >>> path = solve_path(library.paper_beam(), {"A14": 0.10, "A23": 0.10})
        >>> by_a14 = path.derivative("A14")
        >>> by_a14.nodes.shape, by_a14.tensions.shape
        ((24, 3), (48,))
        """
        self.final.raise_for_status()
        direction = direction_of(self.given, of, name)
        arrays, motions = self.given.arrays, self.freedom.neutral
        nodes = self.final.nodes - arrays.origin
        tangent = Tangent(arrays, motions=motions, nodes=nodes)
        settle_tangent(tangent, nodes, self.load)
        rates = differentiate(tangent, self.load, direction)
        if not len(motions):
            return rates
        before = self.stages[-1].nodes - arrays.origin
        framed = in_frame(rates.nodes.reshape(1, 1, -1), nodes[None], before[None], motions)
        return replace(rates, nodes=framed.reshape(-1, 3))

    def raise_for_status(self) -> Self:
        """Return itself, or raise `SolverError` where the last equilibrium is not a stable one."""
        self.final.raise_for_status()
        return self

    def __repr__(self) -> str:
        reason = f" ({self.reason})" if self.reason else ""
        then = "" if self.actuation is None else " and what acts after them"
        events = f"{len(self.critical_points)} critical points, {len(self.slack_events)} slack events"
        text = f"{len(self.stages)} stages{then}; {len(self.history)} steps, {events}"
        if self.actuation is not None and self.actuation.status is not Status.FAILED:
            moved = np.linalg.norm(self.displacements, axis=1)
            most = int(np.argmax(moved))
            unit = self.structure.units.length
            text += f"; node {self.structure.node_ids[most]} moves most, {moved[most]:.4g} {unit}"
        return f"EquilibriumPath({self.structure.name!r}: {self.status}{reason}; {text})"

    def to_dataframe(self) -> "pd.DataFrame":
        """Return every accepted step as a row; no row where the first stage failed.

        Columns are ``stage``, ``parameter`` and ``iterations``, then ``x|y|z_<node>`` in the unit of
        length and ``T_<member>`` in the unit of force.
        """
        import pandas as pd

        columns: dict[str, Any] = {
            "stage": pd.Series([point.stage for point in self.history], dtype="str"),
            "parameter": np.array([point.parameter for point in self.history], dtype=np.float64),
            "iterations": np.array([point.iterations for point in self.history], dtype=np.int64),
        }
        nodes, tensions = history_arrays(self.structure, self.history)
        coordinates = nodes.reshape(len(nodes), 3 * self.structure.n_nodes)
        names = [f"{axis}_{node}" for node in self.structure.nodes for axis in AXES]
        columns |= dict(zip(names, coordinates.T, strict=True))
        columns |= dict(zip((f"T_{member}" for member in self.structure.members), tensions.T, strict=True))
        return pd.DataFrame(columns)

    def to_xarray(self) -> Any:  # noqa: ANN401 - an xarray.Dataset; xarray is an extra
        """Return every accepted step as an `xarray.Dataset` over (step, node, axis) and (step, member).

        Raises
        ------
        ImportError
            Where xarray is not installed (``pip install tensegra[xarray]``).
        """
        xarray = import_module("xarray")
        units = self.structure.units
        nodes, tensions = history_arrays(self.structure, self.history)
        return xarray.Dataset(
            {
                "nodes": (("step", "node", "axis"), nodes, {"units": units.length}),
                "tensions": (("step", "member"), tensions, {"units": units.force}),
                "parameter": (
                    "step",
                    np.array([point.parameter for point in self.history], dtype=np.float64),
                ),
            },
            coords={
                "stage": ("step", np.array([point.stage for point in self.history], dtype=np.str_)),
                "node": list(self.structure.nodes),
                "axis": list(AXES),
                "member": list(self.structure.members),
            },
            attrs={"structure": self.structure.name, "status": str(self.status)},
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values, as `tensegra solve --json` prints them."""
        result: dict[str, Any] = {
            "structure": self.structure.name,
            "units": {
                "length": self.structure.units.length,
                "force": self.structure.units.force,
                "temperature": self.structure.units.temperature,
            },
            "status": str(self.status),
            "reason": self.reason,
            "rigid_motions": list(self.final.rigid_motions),
            "stages": [stage.to_dict() for stage in self.stages],
            "actuation": None,
            "critical_points": [
                {
                    "stage": point.stage,
                    "parameter": point.parameter,
                    "kind": point.kind,
                    "lowest_eigenvalue": _finite(point.lowest_eigenvalue),
                    "moved_nodes": list(point.moved_nodes),
                    "snap": point.snap,
                    "energy_released": point.energy_released,
                }
                for point in self.critical_points
            ],
            "slack_events": [
                {
                    "stage": event.stage,
                    "parameter": event.parameter,
                    "member": event.member,
                    "becomes": event.becomes,
                }
                for event in self.slack_events
            ],
        }
        if self.actuation is not None:
            moved = None
            if self.actuation.status is not Status.FAILED:
                moved = dict(zip(self.structure.nodes, self.displacements.tolist(), strict=True))
            result["actuation"] = self.actuation.to_dict() | {"displacements": moved}
        return result


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
