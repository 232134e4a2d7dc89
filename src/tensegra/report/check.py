"""What can be said of a structure or of a study before it is put to work."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Any

from tensegra.errors import SolverError
from tensegra.mechanics import EquilibriumPath, solve_path
from tensegra.mechanics.stability import (
    LARGEST_SVD,
    SelfStress,
    prestress_stiffness,
    self_stress,
)
from tensegra.mechanics.vibration import Vibration, natural_frequencies
from tensegra.report.members import (
    MemberState,
    likely_slips,
    member_states,
    self_stress_ratios,
    size_of,
    weight_of,
)
from tensegra.report.soundness import require_sound
from tensegra.structure import Structure
from tensegra.study import Study

HELD_BY_NOTHING = "Neither supports nor loads hold the body as a whole"
"""Said of rigid motions that stay free: a normal case, and also what a forgotten support leaves."""

__all__ = ["StructureCheck", "StudyCheck", "check_structure", "check_study"]


@dataclass(frozen=True, eq=False)
class StructureCheck:
    """A structure, its counts, and its loading history solved.

    Attributes
    ----------
    structure
        The structure.
    statics
        Mechanisms and states of self-stress of the given coordinates; None for a structure too
        large for the singular values.
    locked
        The same as if no clustered cable could slide.
    path
        Its stages, without an actuation.
    prestress_stiffness
        Lowest stiffness that the tensions give to the mechanisms, force per length; None where
        there is no stable equilibrium.
    vibration
        Lowest natural frequencies with consistent masses; None where there is no stable equilibrium
        or no mass.
    """

    structure: Structure
    statics: SelfStress | None
    locked: SelfStress | None
    path: EquilibriumPath
    prestress_stiffness: float | None
    vibration: Vibration | None

    @cached_property
    def members(self) -> tuple[MemberState, ...]:
        """The members at the end of the history; none where it found no equilibrium."""
        return member_states(self.path.final) if self.path.final.status != "failed" else ()

    @cached_property
    def self_stress_ratios(self) -> dict[str, list[float]]:
        """The states of self-stress of the given coordinates, by member; none where there are many."""
        return self_stress_ratios(self.structure, self.statics)

    @cached_property
    def slips(self) -> list[str]:
        """Numbers that are likely a slip of units, in sentences."""
        slips = likely_slips(self.structure, self.path.final)
        free = self.path.final.rigid_motions
        return [*slips, f"{HELD_BY_NOTHING}: {', '.join(free)}"] if free else slips

    @property
    def stands(self) -> bool:
        """Whether the last stage ends in a stable equilibrium."""
        return self.path.final.succeeded

    @property
    def verdict(self) -> str:
        """One sentence on the start and the end of the history."""
        first, last = self.path.stages[0], self.path.final
        if first is last or first.succeeded == last.succeeded:
            word = "stands" if last.succeeded else "does not stand"
            return f"It {word}: '{last.stage}' is {last.status}{_because(last.reason)}"
        start = f"its first stage '{first.stage}' is {first.status}{_because(first.reason)}"
        return f"It ends {last.status}, but {start}"

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        structure = self.structure
        solved = self.path.to_dict()
        return {
            "kind": "structure",
            "structure": structure.name,
            "fingerprint": structure.fingerprint,
            "units": solved["units"],
            "n_nodes": structure.n_nodes,
            "n_members": structure.n_members,
            "n_struts": sum(not member.is_cable for member in structure.members.values()),
            "n_clustered": sum(member.is_clustered for member in structure.members.values()),
            "n_free": structure.n_free,
            "n_mechanisms": self.statics and self.statics.n_mechanisms,
            "n_self_stress": self.statics and self.statics.n_self_stress,
            "n_mechanisms_locked": self.locked and self.locked.n_mechanisms,
            "n_self_stress_locked": self.locked and self.locked.n_self_stress,
            "prestress_stiffness": self.prestress_stiffness,
            "natural_frequencies": self.vibration and self.vibration.frequencies.tolist(),
            "size": list(size_of(structure)),
            "weight": weight_of(structure),
            "supports": dict(structure.supports),
            "members": {member.name: member.to_dict() for member in self.members},
            "self_stress_ratios": self.self_stress_ratios,
            "warnings": self.slips,
            "groups": {name: list(members) for name, members in structure.groups.items()},
            "actuators": {
                name: {"members": list(actuator.members), "effect": actuator.effect}
                for name, actuator in structure.actuators.items()
            },
            "stands": self.stands,
            "status": solved["status"],
            "reason": solved["reason"],
            "stages": solved["stages"],
            "critical_points": solved["critical_points"],
        }


@dataclass(frozen=True, eq=False)
class StudyCheck:
    """A study whose file has been read and found to fit its structure."""

    study: Study

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        study = self.study
        return {
            "kind": "study",
            "study": study.name,
            "fingerprint": study.fingerprint,
            "structure": study.structure.name,
            "seed": study.seed,
            "n_points": study.n_points,
            "advice": list(study.advice),
            "variables": {
                variable.name: variable.to_mapping() | {"unit": variable.unit} for variable in study.variables
            },
            "outputs": {output.name: output.to_mapping() | {"unit": output.unit} for output in study.outputs},
            "design": study.design.written(),
            "selection": study.selection.written(),
            "surrogates": {name: entry.written() for name, entry in study.surrogates.items()},
            "analyses": [entry.written() for entry in study.analyses],
        }


def check_structure(structure: Structure) -> StructureCheck:
    """Count the mechanisms of a structure, solve its stages and ask what holds it up.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> check_structure(library.prism()).verdict
    "It stands: 'as given' is stable"
    """
    path = solve_path(structure)
    small = structure.n_free <= LARGEST_SVD
    return StructureCheck(
        structure=structure,
        statics=self_stress(structure) if small else None,
        locked=self_stress(structure, clustered=False) if small else None,
        path=path,
        prestress_stiffness=_finite(prestress_stiffness(path)) if small and path.final.succeeded else None,
        vibration=_vibration(path) if small and path.final.succeeded else None,
    )


def _vibration(path: EquilibriumPath) -> Vibration | None:
    try:
        return natural_frequencies(path)
    except SolverError:  # nothing that moves has a mass
        return None


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def check_study(study: Study) -> StudyCheck:
    """Describe a study, after a last look at what reading it could not check.

    Raises
    ------
    StudyError
        For an objective, a constraint or an option of a surrogate that cannot be.
    """
    require_sound(study)
    return StudyCheck(study)


def _because(reason: str) -> str:
    return f" ({reason})" if reason else ""
