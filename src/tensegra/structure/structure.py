"""The frozen model of a structure: nodes, members, materials, supports, actuators and stages.

Objects are plain and immutable. A `Structure` checks itself when it is made, by the same rules
whether it is read from a file, merged from changes or written out in Python, so one that exists is
sound: every name it uses is known and every number it holds is possible.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from hashlib import sha256
from itertools import pairwise
from math import dist
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tensegra.errors import ModelError
from tensegra.presented import Presented
from tensegra.savable import Savable
from tensegra.structure.checks import find_problems, is_vector
from tensegra.structure.coerce import Vector, by_id, name_of, sorted_axes, store, vector
from tensegra.structure.frozen import FrozenMapping
from tensegra.structure.parts import AS_DRAWN, STRAIN_LIMIT, Actuator, Material, Member, Stage
from tensegra.structure.problems import InvalidStructureError
from tensegra.units import Units
from tensegra.viewable import Viewable

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

__all__ = ["Structure", "path_length"]

_SI = Units()


@dataclass(frozen=True, eq=False, repr=False)
class Structure(Presented, Savable, Viewable):
    """A tensegrity structure with its supports, actuators and loading history.

    Ids are texts; integers are accepted and become texts. All numbers are in `units`. Structures are
    equal when their content is, the order of nodes and members included.

    Parameters
    ----------
    name, description
        For people; no result depends on them.
    units
        The unit system; metre, newton and kelvin if left out.
    nodes
        Id → coordinates in the stress-free drawing, from which the first equilibrium is sought.
    materials, members, actuators
        Name → object.
    supports
        Node → the axes along which it is held, such as ``"xyz"`` or ``"z"``.
    gravity
        Factor on the members' weights along each axis.
    stages
        The loading history, in order.

    Raises
    ------
    ModelError
        Something in it cannot be; the message says where, and what was expected.

    Examples
    --------
    >>> Structure(
    ...     name="rope",
    ...     nodes={1: (0, 0, 0), 2: (2, 0, 0)},
    ...     members={"K1": Member("cable", (1, 2), rest_length=1.9, stiffness=1e5)},
    ...     supports={1: "xyz", 2: "yz"},
    ... )
    Structure('rope': 2 nodes, 0 struts, 1 cable, 0 clustered; 1 free dof; units m, N)
    """

    name: str
    nodes: Mapping[str, Vector]
    members: Mapping[str, Member]
    materials: Mapping[str, Material] = FrozenMapping()
    supports: Mapping[str, str] = FrozenMapping()
    gravity: Vector = (0.0, 0.0, 0.0)
    actuators: Mapping[str, Actuator] = FrozenMapping()
    stages: tuple[Stage, ...] = ()
    units: Units = _SI
    description: str = ""

    def __post_init__(self) -> None:
        store(
            self,
            name=name_of(self.name),
            nodes=by_id("nodes", self.nodes, vector),
            members=by_id("members", self.members),
            materials=by_id("materials", self.materials),
            supports=by_id("supports", self.supports, sorted_axes),
            gravity=vector(self.gravity),
            actuators=by_id("actuators", self.actuators),
            stages=tuple(self.stages),
        )
        store(self, members=_with_rest_lengths(self.nodes, self.members))
        problems = tuple(find_problems(self))
        if problems:
            raise InvalidStructureError.of(problems)

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @property
    def n_members(self) -> int:
        """Number of members."""
        return len(self.members)

    @property
    def n_free(self) -> int:
        """Number of coordinates that no support holds."""
        return 3 * self.n_nodes - sum(map(len, self.supports.values()))

    @cached_property
    def node_ids(self) -> tuple[str, ...]:
        """The ids of the nodes, in the order of every array over nodes."""
        return tuple(self.nodes)

    @cached_property
    def member_ids(self) -> tuple[str, ...]:
        """The ids of the members, in the order of every array over members."""
        return tuple(self.members)

    @cached_property
    def groups(self) -> Mapping[str, tuple[str, ...]]:
        """The members of each group."""
        groups: dict[str, list[str]] = {}
        for member_id, member in self.members.items():
            for group in member.groups:
                groups.setdefault(group, []).append(member_id)
        return FrozenMapping({group: tuple(members) for group, members in groups.items()})

    @cached_property
    def coordinates(self) -> "NDArray[np.float64]":
        """The nodes' coordinates, (n_nodes, 3), read-only."""
        coordinates = np.array(list(self.nodes.values()), dtype=float)
        coordinates.flags.writeable = False
        return coordinates

    def members_named(self, name: str | int) -> tuple[str, ...]:
        """Return the members that `name` addresses: the member itself, or those of the group.

        Raises
        ------
        ModelError
            Neither a member nor a group has this name.
        """
        name = str(name)
        if name in self.members:
            return (name,)
        if name in self.groups:
            return self.groups[name]
        known = (*self.members, *self.groups)
        raise ModelError.at(self.name, name, "the id of a member or of a group", candidates=known)

    def member(self, member_id: str | int) -> Member:
        """Return a member.

        Raises
        ------
        ModelError
            No member has this id.
        """
        member = self.members.get(str(member_id))
        if member is None:
            raise ModelError.at(self.name, str(member_id), "the id of a member", candidates=self.members)
        return member

    def axial_stiffness(self, member_id: str | int) -> float:
        """Return EA of a member, a force."""
        member = self.member(member_id)
        if member.stiffness is not None:
            return member.stiffness
        assert member.material is not None  # noqa: S101 — checked when the structure was made
        assert member.area is not None  # noqa: S101 — idem
        return self.materials[member.material].youngs_modulus * member.area

    def weight_per_length(self, member_id: str | int) -> float:
        """Return the weight of a unit of a member's length under unit gravity; 0 without an area."""
        member = self.member(member_id)
        if member.material is None or member.area is None:
            return 0.0
        return self.materials[member.material].weight * member.area

    def strain_limit(self, member_id: str | int) -> float:
        """Return the strain up to which a member's linear law is trusted."""
        material = self.members[str(member_id)].material
        limit = None if material is None else self.materials[material].strain_limit
        return STRAIN_LIMIT if limit is None else limit

    def thermal_expansion(self, member_id: str | int) -> float:
        """Return the strain of a member per degree; 0 without a material."""
        material = self.member(member_id).material
        return 0.0 if material is None else self.materials[material].thermal_expansion

    def replace(self, **changes: Any) -> Self:  # noqa: ANN401 — each field has its own type
        """Return a copy with some fields exchanged, checked anew.

        Examples
        --------
        >>> from tensegra.structure import library
        >>> library.paper_beam().replace(gravity=(0, 0, 0)).gravity
        (0.0, 0.0, 0.0)
        """
        return replace(self, **changes)

    def to_dataframe(self) -> "pd.DataFrame":
        """Return a row for each member, in the structure's units.

        Columns are ``member``, ``kind``, ``nodes``, ``length`` (between the nodes as they are drawn),
        ``rest_length``, ``stiffness`` (EA), ``weight`` (of the whole rest length under unit gravity),
        ``material`` and ``groups``.
        """
        import pandas as pd

        return pd.DataFrame(
            {
                "member": name,
                "kind": "clustered cable" if member.is_clustered else member.kind,
                "nodes": "-".join(member.nodes),
                "length": path_length(self.nodes, member.nodes),
                "rest_length": member.rest_length,
                "stiffness": self.axial_stiffness(name),
                "weight": self.weight_per_length(name) * member.rest_length,
                "material": member.material or "",
                "groups": ", ".join(member.groups),
            }
            for name, member in self.members.items()
        )

    @cached_property
    def fingerprint(self) -> str:
        """The SHA-256, in hexadecimal, of all that a result can depend on: not of name and description."""
        return sha256(_canonical(self, leave_out=("name", "description")).encode()).hexdigest()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Structure):
            return NotImplemented
        return self is other or _canonical(self) == _canonical(other)

    def __hash__(self) -> int:
        return hash(self.fingerprint)

    def __getstate__(self) -> dict[str, object]:
        # What is derived is derived again: an unpickled array could be written to.
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def __repr__(self) -> str:
        n_struts = sum(not member.is_cable for member in self.members.values())
        n_clustered = sum(member.is_clustered for member in self.members.values())
        n_cables = self.n_members - n_struts - n_clustered
        return (
            f"Structure({self.name!r}: {_count(self.n_nodes, 'node')}, {_count(n_struts, 'strut')}, "
            f"{_count(n_cables, 'cable')}, {n_clustered} clustered; {self.n_free} free dof; "
            f"units {self.units})"
        )


def _with_rest_lengths(nodes: Mapping[str, Vector], members: Mapping[str, Member]) -> Mapping[str, Member]:
    """Give each member without a rest length the length of its path; an unknown node is refused later."""
    open_ones = {
        name: replace(member, rest_length=path_length(nodes, member.nodes))
        for name, member in members.items()
        if isinstance(member, Member)
        and member.rest_length is AS_DRAWN
        and all(is_vector(nodes.get(node)) for node in member.nodes)
    }
    return FrozenMapping({**members, **open_ones}) if open_ones else members


def path_length(nodes: Mapping[str, Vector], path: Iterable[str]) -> float:
    """Return the length of a path over `nodes`.

    Examples
    --------
    >>> path_length({"1": (0, 0, 0), "2": (3, 4, 0), "3": (3, 4, 1)}, ["1", "2", "3"])
    6.0
    """
    return sum(dist(nodes[start], nodes[end]) for start, end in pairwise(path))


def _canonical(structure: Structure, leave_out: tuple[str, ...] = ()) -> str:
    from tensegra.structure.mapping import structure_to_mapping

    mapping = structure_to_mapping(structure)
    return json.dumps({key: value for key, value in mapping.items() if key not in leave_out})


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
