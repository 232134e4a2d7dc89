"""What a structure must satisfy. This is the only place that knows: files, changes and Python share it."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from math import dist, inf, isclose, isfinite
from typing import TYPE_CHECKING

from tensegra.structure.overlaps import find_overlaps, member_parts
from tensegra.structure.parts import AS_DRAWN
from tensegra.structure.problems import NOTHING, Place, Problem
from tensegra.units import LARGEST, SMALLEST, is_number, is_sane

if TYPE_CHECKING:
    from tensegra.structure.parts import Member, Stage
    from tensegra.structure.structure import Structure

__all__ = ["AXES", "find_problems", "is_vector"]

AXES = "xyz"
_SUPPORTS = ("x", "y", "z", "xy", "xz", "yz", "xyz")

# A repeated coordinate may have gone through another unit on its way here.
_SAME_COORDINATE = 1e-9

MOST_RATIO = 1e6
"""Between two lengths of one member: millimetres for kilometres. Beyond, a path would take as many steps."""

MEMBER_OR_GROUP = "the id of a member or of a group"

LONGEST_FACTOR = 1e3
"""By which a rest length can be multiplied: no material and no winch does, a slip of units does."""


def find_problems(structure: "Structure") -> Iterator[Problem]:
    """Yield all that is wrong with a structure, in the order of its file."""
    yield from _nodes(structure)
    yield from _materials(structure)
    for name, member in structure.members.items():
        yield from _member(structure, ("members", name), member)
    yield from _groups(structure)
    yield from _supports(structure)
    yield from _vector(("gravity",), structure.gravity)
    yield from _actuators(structure)
    yield from _stages(structure)
    yield from _connections(structure)


def _nodes(structure: "Structure") -> Iterator[Problem]:
    if not structure.members:
        yield Problem(("members",), NOTHING, "at least one member")
    yield from _text(("name",), structure.name)
    for section in ("nodes", "materials", "members", "actuators"):
        for name in getattr(structure, section):
            yield from _text((section,), name)
    for node, position in structure.nodes.items():
        yield from _vector(("nodes", node), position)


def _materials(structure: "Structure") -> Iterator[Problem]:
    for name, material in structure.materials.items():
        place = ("materials", name)
        yield from _number((*place, "youngs_modulus"), material.youngs_modulus, above=0.0)
        yield from _number((*place, "weight"), material.weight, least=0.0)
        yield from _number((*place, "thermal_expansion"), material.thermal_expansion)
        if material.strain_limit is not None:
            yield from _number((*place, "strain_limit"), material.strain_limit, above=0.0)


def _member(structure: "Structure", place: Place, member: "Member") -> Iterator[Problem]:
    kinds = ("strut", "cable")
    if member.kind not in kinds:
        yield Problem((*place, "kind"), member.kind, "'strut' or 'cable'", kinds)
    path_problems = [*_path(structure, (*place, "nodes"), member)]
    yield from path_problems
    yield from _section(structure, place, member)
    if not path_problems and member.rest_length is not AS_DRAWN:
        # One that is still to be measured could not be: a node's own problem is told instead.
        where = (*place, "rest_length")
        problems = [*_number(where, member.rest_length, above=0.0)]
        yield from problems
        positions = [structure.nodes[node] for node in member.nodes]
        if not problems and all(map(is_vector, positions)):
            along = sum(dist(start, end) for start, end in pairwise(positions))
            yield from _of_one_size(where, member.rest_length, along, "the length along the nodes")
    for group in member.groups:
        yield from _text((*place, "groups"), group)


def _path(structure: "Structure", place: Place, member: "Member") -> Iterator[Problem]:
    path = member.nodes
    if len(path) < 2:
        yield Problem(place, list(path), "a path of at least two nodes")
    elif member.kind == "strut" and len(path) > 2:
        yield Problem(place, list(path), "two nodes, for a strut runs straight between them")
    yield from _known(place, path, structure.nodes, "the id of a node")
    for index, (start, end) in enumerate(member.segments, start=1):
        if start == end:
            yield Problem((*place, index), end, "another node than the one before it")
        elif _coincide(structure, start, end):
            yield Problem(
                (*place, index), end, f"a node apart from {start!r}: the segment between them has no length"
            )


def _coincide(structure: "Structure", start: str, end: str) -> bool:
    return start in structure.nodes and structure.nodes[start] == structure.nodes.get(end)


def _section(structure: "Structure", place: Place, member: "Member") -> Iterator[Problem]:
    if member.material is not None:
        yield from _known(place, [member.material], structure.materials, "the name of a material", "material")
    if member.stiffness is not None:
        yield from _number((*place, "stiffness"), member.stiffness, above=0.0)
        if member.area is not None:
            yield Problem(
                (*place, "area"), member.area, "no area beside a stiffness: the stiffness is EA already"
            )
    elif member.area is None and member.material is None:
        yield Problem(place, NOTHING, "either material and area, or stiffness (EA)")
    elif member.area is None:
        yield Problem((*place, "area"), NOTHING, "an area beside the material, or a stiffness (EA)")
    else:
        yield from _number((*place, "area"), member.area, above=0.0)
        if member.material is None:
            yield Problem(
                (*place, "material"),
                NOTHING,
                "the name of a material beside the area",
                tuple(structure.materials),
            )
    if member.section_inertia is not None:
        yield from _number((*place, "section_inertia"), member.section_inertia, above=0.0)
        if member.kind == "cable" or member.material is None:
            yield Problem(
                (*place, "section_inertia"), member.section_inertia, "this key in struts with a material only"
            )
    if member.strength is not None:
        yield from _number((*place, "strength"), member.strength, above=0.0)


def _groups(structure: "Structure") -> Iterator[Problem]:
    for name, member in structure.members.items():
        for index, group in enumerate(member.groups):
            place = ("members", name, "groups", index)
            if group in structure.members:
                yield Problem(place, group, "another name, for a member has this one")
            elif group in member.groups[:index]:
                yield Problem(place, group, "each group once")


def _supports(structure: "Structure") -> Iterator[Problem]:
    yield from _known(("supports",), structure.supports, structure.nodes, "the id of a node", None)
    for node, axes in structure.supports.items():
        if axes not in _SUPPORTS:
            yield Problem(("supports", node), axes, "axes out of x, y and z, such as 'xyz'", _SUPPORTS)


def _actuators(structure: "Structure") -> Iterator[Problem]:
    effects = ("shorten", "lengthen")
    for name, actuator in structure.actuators.items():
        place = ("actuators", name)
        if not actuator.members:
            yield Problem((*place, "members"), [], "at least one member")
        yield from _known((*place, "members"), actuator.members, structure.members, MEMBER_OR_GROUP)
        earlier: set[str] = set()
        for index, member in enumerate(actuator.members):
            if member in earlier:
                yield Problem((*place, "members", index), member, "each member once")
            earlier.add(member)
        if actuator.effect not in effects:
            yield Problem((*place, "effect"), actuator.effect, "'shorten' or 'lengthen'", effects)


def _stages(structure: "Structure") -> Iterator[Problem]:
    names: set[str] = set()
    for index, stage in enumerate(structure.stages):
        place = ("stages", index)
        yield from _text((*place, "name"), stage.name)
        if stage.name in names:
            yield Problem((*place, "name"), stage.name, "a name that no earlier stage has")
        names.add(stage.name)
        yield from _stage_rest_lengths(structure, place, stage)
        yield from _stage_temperatures(structure, place, stage)
        yield from _known((*place, "loads"), stage.loads, structure.nodes, "the id of a node", None)
        for node, load in stage.loads.items():
            yield from _vector((*place, "loads", node), load)
        yield from _stage_positions(structure, place, stage)
        if stage.gravity is not None:
            yield from _vector((*place, "gravity"), stage.gravity)


def _stage_rest_lengths(structure: "Structure", place: Place, stage: "Stage") -> Iterator[Problem]:
    for key in ("rest_length_changes", "rest_lengths"):
        yield from _known((*place, key), getattr(stage, key), structure.members, MEMBER_OR_GROUP, None)
    for member, change in stage.rest_length_changes.items():
        where = (*place, "rest_length_changes", member)
        yield from _number(where, change, above=-1.0, reason=": the member keeps no rest length otherwise")
        if is_number(change) and LONGEST_FACTOR <= 1.0 + change < inf:
            yield Problem(
                where, change, f"a number below {LONGEST_FACTOR - 1:g}, relative to the rest length"
            )
        if member in stage.rest_lengths:
            yield Problem(where, change, "no change beside a new rest length of the same member in one stage")
    for member, rest_length in stage.rest_lengths.items():
        where = (*place, "rest_lengths", member)
        problems = [*_number(where, rest_length, above=0.0)]
        yield from problems
        if not problems and member in structure.members:
            before = structure.members[member].rest_length
            yield from _of_one_size(where, rest_length, before, "the rest length that the member begins with")


def _of_one_size(place: Place, value: float, other: float, what: str) -> Iterator[Problem]:
    """Refuse a length that is another size than the one it has to do with, as only a slip makes it."""
    if (
        is_number(other)
        and isfinite(other)
        and other > 0.0
        and not 1.0 / MOST_RATIO < value / other < MOST_RATIO
    ):
        yield Problem(place, value, f"a length within a factor of {MOST_RATIO:g} of {other:.6g}, {what}")


def _stage_temperatures(structure: "Structure", place: Place, stage: "Stage") -> Iterator[Problem]:
    names = {**structure.members, **structure.groups}
    yield from _known((*place, "temperatures"), stage.temperatures, names, MEMBER_OR_GROUP, None)
    sound: list[str] = []
    for name, difference in stage.temperatures.items():
        where = (*place, "temperatures", name)
        problems = [*_number(where, difference)]
        yield from problems
        if problems or name not in names:
            continue
        sound.append(name)
        for member in structure.members_named(name):
            material = structure.materials.get(structure.members[member].material or "")
            factor = 1.0 if material is None else 1.0 + material.thermal_expansion * difference
            if factor <= 0.0:
                yield Problem(where, difference, f"a temperature that leaves member {member!r} a rest length")
            elif factor >= LONGEST_FACTOR:
                expected = f"a temperature that lengthens member {member!r} less than {LONGEST_FACTOR:g}-fold"
                yield Problem(where, difference, expected)
    for overlap in find_overlaps((name, member_parts(structure, name)) for name in sound):
        where = (*place, "temperatures", overlap.name)
        yield Problem(where, stage.temperatures[overlap.name], overlap.expected("temperature"))


def _stage_positions(structure: "Structure", place: Place, stage: "Stage") -> Iterator[Problem]:
    yield from _known(
        (*place, "positions"), stage.positions, structure.supports, "the id of a supported node", None
    )
    for node, position in stage.positions.items():
        where = (*place, "positions", node)
        problems = [*_vector(where, position)]
        yield from problems
        if problems or node not in structure.nodes:
            continue
        for axis, (now, given) in enumerate(zip(position, structure.nodes[node], strict=True)):
            held = AXES[axis] in structure.supports.get(node, "")
            if not held and node in structure.supports and not isclose(now, given, rel_tol=_SAME_COORDINATE):
                yield Problem(
                    (*where, axis),
                    now,
                    f"{given}, as in `nodes`: no support holds the node along {AXES[axis]}",
                )


def _connections(structure: "Structure") -> Iterator[Problem]:
    """Refuse nodes without a member, and a part without a support beside other parts."""
    touched = {node for member in structure.members.values() for node in member.nodes}
    if not touched <= structure.nodes.keys():
        return  # a misspelt node is told already, and would leave the one that was meant alone
    for node in structure.nodes:
        if node not in touched:
            yield Problem(("nodes", node), node, "a node that a member touches")
    part_of = _parts(structure)
    first_of: dict[str, str] = {}
    for node in filter(touched.__contains__, structure.nodes):
        first_of.setdefault(part_of[node], node)
    supported = {part_of[node] for node in structure.supports if node in touched}
    for part, first in first_of.items():
        if len(first_of) > 1 and part not in supported:
            yield Problem(("nodes", first), first, "a node connected to the others, or a support in its part")


def _parts(structure: "Structure") -> dict[str, str]:
    """Return, for each node, the one that stands for all that members connect it to."""
    parent = {node: node for node in structure.nodes}

    def root(node: str) -> str:
        while parent[node] != node:
            parent[node] = node = parent[parent[node]]
        return node

    for member in structure.members.values():
        for node in member.nodes[1:]:
            parent[root(node)] = root(member.nodes[0])
    return {node: root(node) for node in structure.nodes}


def _text(place: Place, text: object) -> Iterator[Problem]:
    if not (isinstance(text, str) and text.strip() == text != "" and text.isprintable()):
        yield Problem(place, text, "a name: a whole number, or a text on one line")


def is_vector(value: object) -> bool:
    """Tell whether a position can be computed with; what is wrong with it is told elsewhere."""
    return isinstance(value, tuple) and len(value) == 3 and all(is_number(x) and isfinite(x) for x in value)


def _vector(place: Place, vector: object) -> Iterator[Problem]:
    if not isinstance(vector, tuple) or len(vector) != 3:
        yield Problem(place, vector, "three numbers [x, y, z]")
        return
    for axis, component in enumerate(vector):
        yield from _number((*place, axis), component)


def _number(
    place: Place, value: object, *, above: float = -inf, least: float = -inf, reason: str = ""
) -> Iterator[Problem]:
    if not is_number(value) or not isfinite(value):  # type: ignore[arg-type]
        yield Problem(place, value, "a finite number")
    elif not is_sane(value):  # type: ignore[arg-type]
        yield Problem(place, value, f"0, or a number from {SMALLEST:g} to {LARGEST:g} in size")
    elif value <= above:  # type: ignore[operator]
        yield Problem(place, value, f"a number greater than {above:g}{reason}")
    elif value < least:  # type: ignore[operator]
        yield Problem(place, value, f"a number of at least {least:g}{reason}")


def _known(
    place: Place,
    names: Iterable[str],
    known: Mapping[str, object],
    expected: str,
    key: str | int | None = -1,
) -> Iterator[Problem]:
    """Refuse unknown names: items of a list at `place`, its value at `key`, or keys of it (None)."""
    for index, name in enumerate(names):
        if name not in known:
            below: Place = () if key is None else (index if key == -1 else key,)
            yield Problem((*place, *below), name, expected, tuple(known))
