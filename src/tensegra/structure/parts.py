"""The parts of a structure: materials, members, actuators and stages."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Literal

from tensegra.structure.coerce import Vector, by_id, name_of, names, number, store, vector
from tensegra.structure.frozen import FrozenMapping

__all__ = ["AS_DRAWN", "STRAIN_LIMIT", "Actuator", "Effect", "Kind", "Material", "Member", "Stage"]

STRAIN_LIMIT = 0.05
"""Limit of a material that names none: far beyond the yield of metals, within that of many fibres."""

Kind = Literal["strut", "cable"]
Effect = Literal["shorten", "lengthen"]


AS_DRAWN = float("nan")
"""The rest length of a member that is as long as the path between its nodes: this object and no other NaN."""


@dataclass(frozen=True)
class Material:
    """What members are made of.

    Parameters
    ----------
    youngs_modulus
        Force per area.
    weight
        Force per volume.
    thermal_expansion
        Strain per degree of temperature difference.
    strain_limit
        Largest strain, in tension or compression, up to which the linear law is trusted, such as that at
        yield; `STRAIN_LIMIT` where left out.
    """

    youngs_modulus: float
    weight: float = 0.0
    thermal_expansion: float = 0.0
    strain_limit: float | None = None

    def __post_init__(self) -> None:
        store(self, **{field.name: number(getattr(self, field.name)) for field in fields(self)})


@dataclass(frozen=True)
class Member:
    """A strut or a cable: a path over two or more nodes with one rest length and one tension.

    Parameters
    ----------
    kind
        A cable carries tension only; a strut carries both signs.
    nodes
        Ids in the order of the path. A cable over three or more nodes is clustered: it runs over
        frictionless pulleys. A closed loop repeats its first node at the end.
    rest_length
        Length of the whole path free of force. A member without one, or with None, becomes as long as the
        path between its nodes when a structure is made of it; until then it is `AS_DRAWN`.
    material, area
        Name of the material and cross-section; together they give the axial stiffness EA.
    stiffness
        EA itself, a force, instead of an area. A material may be named beside it and then gives the
        thermal expansion alone: without an area there is no weight.
    groups
        Names under which members are addressed together.
    section_inertia
        Second moment of area of a strut, for its buckling load; needs a material.
    strength
        Largest force that the member may carry.
    """

    kind: Kind
    nodes: tuple[str, ...]
    rest_length: float = AS_DRAWN
    material: str | None = None
    area: float | None = None
    stiffness: float | None = None
    groups: tuple[str, ...] = ()
    section_inertia: float | None = None
    strength: float | None = None

    def __post_init__(self) -> None:
        store(
            self,
            nodes=names(self.nodes),
            groups=names(self.groups),
            rest_length=_length(self.rest_length),
            area=number(self.area),
            stiffness=number(self.stiffness),
            section_inertia=number(self.section_inertia),
            strength=number(self.strength),
        )

    @property
    def is_cable(self) -> bool:
        """Whether the member goes slack instead of carrying compression."""
        return self.kind == "cable"

    @property
    def is_clustered(self) -> bool:
        """Whether the member runs over three or more nodes."""
        return len(self.nodes) > 2

    @property
    def segments(self) -> tuple[tuple[str, str], ...]:
        """The pairs of successive nodes."""
        return tuple(pairwise(self.nodes))


def _length(value: Any) -> Any:  # noqa: ANN401 - as `number`
    """Return a rest length in form; what is left out is measured along the nodes."""
    return AS_DRAWN if value is None else number(value)


@dataclass(frozen=True)
class Actuator:
    """A device that shortens or lengthens the rest lengths of its members together."""

    members: tuple[str, ...]
    effect: Effect

    def __post_init__(self) -> None:
        store(self, members=names(self.members))

    def factor(self, value: float) -> float:
        """Return the factor on the rest lengths: 1 − `value` to shorten, 1 + `value` to lengthen.

        Examples
        --------
        >>> Actuator(("K1", "K4"), "shorten").factor(0.25)
        0.75
        """
        return 1.0 - value if self.effect == "shorten" else 1.0 + value


@dataclass(frozen=True)
class Stage:
    """One entry of the loading history. What a stage does not name stays as it was.

    Parameters
    ----------
    name
        Unique within the structure.
    rest_length_changes
        Member → change relative to the rest length before the stage.
    rest_lengths
        Member → new rest length.
    loads
        Node → force; replaces the node's earlier load.
    temperatures
        Member or group → difference from the stress-free state.
    positions
        Supported node → its new coordinates. Along an axis that is not supported the coordinate
        must be the one given in `nodes`, for nothing holds the node elsewhere.
    gravity
        Factor on the members' weights; None leaves it as it was.
    """

    name: str
    rest_length_changes: Mapping[str, float] = FrozenMapping()
    rest_lengths: Mapping[str, float] = FrozenMapping()
    loads: Mapping[str, Vector] = FrozenMapping()
    temperatures: Mapping[str, float] = FrozenMapping()
    positions: Mapping[str, Vector] = FrozenMapping()
    gravity: Vector | None = None

    def __post_init__(self) -> None:
        store(self, name=name_of(self.name))
        for name in ("rest_length_changes", "rest_lengths", "temperatures"):
            store(self, **{name: by_id(name, getattr(self, name), number)})
        for name in ("loads", "positions"):
            store(self, **{name: by_id(name, getattr(self, name), vector)})
        if self.gravity is not None:
            store(self, gravity=vector(self.gravity))
