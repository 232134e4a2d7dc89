"""The members of a structure as they stand, its size and weight, and what looks like a slip of units."""

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegra.mechanics.strains import strain_warning
from tensegra.structure import Structure, Units
from tensegra.structure.structure import path_length
from tensegra.units import Dimension

if TYPE_CHECKING:
    from tensegra.mechanics import Equilibrium
    from tensegra.mechanics.stability import SelfStress

__all__ = ["MemberState", "likely_slips", "member_states", "self_stress_ratios", "size_of", "weight_of"]

HEAVY = 100.0
"""A weight so many times the largest tension is held by no prestress."""

STOUT, THIN = 0.5, 1e-6
"""Side of a square of a member's area, relative to its length: beyond these it is no bar and no wire."""

MODULI, WEIGHTS = (1e4, 2e12), (1.0, 1e6)
"""Pascals from rubber foam to diamond; newtons per cubic metre from an aerogel to beyond osmium."""

MOST_RATIOS = 3
"""States of self-stress that are listed: of many, the choice is arbitrary."""


@dataclass(frozen=True)
class MemberState:
    """A member in an equilibrium.

    Attributes
    ----------
    name, kind
        Which it is, and ``strut``, ``cable`` or ``clustered cable``.
    rest_length
        After the stages, without temperature.
    length
        Along its path as it stands; NaN where there is no equilibrium, as all that follows.
    strain
        Of the material, T/EA.
    tension, force_density
        T, and T by the length.
    utilisation
        The share of the strength or of the buckling load; None where neither is known.
    """

    name: str
    kind: str
    rest_length: float
    length: float
    strain: float
    tension: float
    force_density: float
    utilisation: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        values = {key: value for key, value in vars(self).items() if key != "name"}
        return {key: None if value != value else value for key, value in values.items()}  # noqa: PLR0124 - NaN


def member_states(equilibrium: "Equilibrium") -> tuple[MemberState, ...]:
    """Return the state of every member, in the order of the structure."""
    structure = equilibrium.structure
    positions = dict(zip(structure.node_ids, map(tuple, equilibrium.nodes.tolist()), strict=True))
    utilisation = equilibrium.utilisation if equilibrium.succeeded else {}
    states = []
    for (name, member), tension in zip(structure.members.items(), equilibrium.tensions.tolist(), strict=True):
        length = path_length(positions, member.nodes)
        kind = "clustered cable" if member.is_clustered else member.kind
        states.append(
            MemberState(
                name=name,
                kind=kind,
                rest_length=_rest_length(structure, name),
                length=length,
                strain=tension / structure.axial_stiffness(name),
                tension=tension,
                force_density=tension / length,
                utilisation=utilisation.get(name),
            )
        )
    return tuple(states)


def _rest_length(structure: Structure, name: str) -> float:
    """Return a member's rest length after the stages."""
    length = structure.members[name].rest_length
    for stage in structure.stages:
        length = stage.rest_lengths.get(name, length * (1.0 + stage.rest_length_changes.get(name, 0.0)))
    return length


def size_of(structure: Structure) -> tuple[float, float, float]:
    """Return the extent of the given coordinates along each axis.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> size_of(library.von_mises_truss())[1]
    0.0
    """
    x, y, z = np.ptp(structure.coordinates, axis=0).tolist()
    return x, y, z


def weight_of(structure: Structure) -> float:
    """Return the weight of all members under unit gravity, by the lengths along the given coordinates."""
    return sum(
        structure.weight_per_length(name) * path_length(structure.nodes, member.nodes)
        for name, member in structure.members.items()
    )


def self_stress_ratios(structure: Structure, statics: "SelfStress | None") -> dict[str, list[float]]:
    """Return the states of self-stress over the members, each relative to its largest force, tension first.

    Examples
    --------
    >>> from tensegra.mechanics.stability import self_stress
    >>> from tensegra.structure import library
    >>> prism = library.prism()
    >>> ratios = self_stress_ratios(prism, self_stress(prism))
    >>> round(ratios["s0"][0], 3), round(ratios["v0"][0], 3)
    (-1.0, 0.518)
    """
    if statics is None or not 0 < statics.n_self_stress <= MOST_RATIOS:
        return {}
    cables = [member.is_cable for member in structure.members.values()]
    states = statics.states / np.abs(statics.states).max(axis=1, keepdims=True)
    states *= np.where(states[:, cables].sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    return {name: states[:, i].tolist() for i, name in enumerate(structure.member_ids)}


def likely_slips(structure: Structure, equilibrium: "Equilibrium") -> list[str]:
    """Return, in sentences, numbers that are possible and yet likely a slip of units."""
    states = member_states(equilibrium) if equilibrium.status != "failed" else ()
    return [
        *_of_materials(structure),
        *_of_sections(structure),
        *(_of_strains(structure, states) if states else ()),
        *_of_weight(structure, equilibrium),
    ]


def _of_strains(structure: Structure, states: tuple[MemberState, ...]) -> list[str]:
    said = []
    beyond = strain_warning(structure, np.array([state.strain for state in states]))
    if beyond:
        said.append(f"{beyond}; are modulus, area and rest length in the units declared?")
    overloaded = [state for state in states if state.utilisation is not None and state.utilisation > 1.0]
    if overloaded:
        worst = max(overloaded, key=lambda state: state.utilisation or 0.0)
        share = 100 * (worst.utilisation or 0.0)
        said.append(
            f"{_members(len(overloaded))} loaded beyond strength or buckling load, most of all {worst.name} "
            f"({share:.3g} %); are strength, inertia and loads in the units declared?"
        )
    return said


def _of_weight(structure: Structure, equilibrium: "Equilibrium") -> list[str]:
    gravity = np.linalg.norm(structure.gravity)
    for stage in structure.stages:
        gravity = gravity if stage.gravity is None else np.linalg.norm(stage.gravity)
    weight = weight_of(structure) * float(gravity)
    if equilibrium.status == "failed":
        return []
    largest = float(np.abs(equilibrium.tensions).max(initial=0.0))
    if weight <= HEAVY * largest or largest == 0.0:
        return []
    force = structure.units.force
    unit = structure.units.of("force per volume")
    found = f"The weight, {weight:.4g} {force}, is far above the largest tension, {largest:.4g} {force}"
    return [f"{found}; is the materials' weight in {unit}?"]


def _of_sections(structure: Structure) -> list[str]:
    for name, member in structure.members.items():
        if member.area is None:
            continue
        ratio = sqrt(member.area) / path_length(structure.nodes, member.nodes)
        if THIN < ratio < STOUT:
            continue
        shape = "as thick as long" if ratio >= STOUT else "a millionth as thick as long"
        units = f"{structure.units.of('area')} and {structure.units.length}"
        return [f"Member {name} is {shape}; are areas and coordinates in {units}?"]
    return []


def _of_materials(structure: Structure) -> list[str]:
    said = []
    for name, material in structure.materials.items():
        modulus = _in(structure.units, material.youngs_modulus, "stress", Units())
        if not MODULI[0] <= modulus <= MODULI[1]:
            said.append(
                f"Material {name} has a modulus of {modulus:.3g} Pa, which no solid has; is it in "
                f"{structure.units.of('stress')}?"
            )
        weight = _in(structure.units, material.weight, "force per volume", Units())
        if weight != 0.0 and not WEIGHTS[0] <= weight <= WEIGHTS[1]:
            said.append(
                f"Material {name} weighs {weight:.3g} N/m^3, which nothing does; is it a force, in "
                f"{structure.units.of('force per volume')}?"
            )
    return said


def _in(units: Units, value: float, dimension: Dimension, others: Units) -> float:
    """Convert a number from one system into another."""
    return others.number(f"{value!r} {units.of(dimension)}", dimension)


def _members(count: int) -> str:
    return f"{count} members are" if count > 1 else "1 member is"
