"""What a foreign file does not say and its reader must: units, stiffnesses, which layer is what."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tensegra.errors import ModelError
from tensegra.mechanics.law import plain as law
from tensegra.structure import Structure, Units
from tensegra.structure.coerce import vector
from tensegra.structure.fileformat import build
from tensegra.structure.mapping import SCHEMA
from tensegra.structure.structure import path_length
from tensegra.units import QuantityError, is_number

__all__ = ["Content", "Said", "structure_of"]

Content = dict[str, Any]
"""The content of a structure file, where `units` and stiffnesses may be missing. A member may have a
`tension` in place of a rest length."""

Quantity = float | str


@dataclass(frozen=True)
class Said:
    """What is said of a foreign file beside it.

    Parameters
    ----------
    unit, force_unit
        Units of length and of force of its numbers; what the file says, or else m and N, if left out.
    strut_stiffness, cable_stiffness
        EA of the members for which the file has none, a force: a number or a quantity such as "2 MN".
    struts, cables
        Layers of a drawing whose lines are struts, or cables, whatever their names.
    """

    unit: str | None = None
    force_unit: str | None = None
    strut_stiffness: Quantity | None = None
    cable_stiffness: Quantity | None = None
    struts: tuple[str, ...] = ()
    cables: tuple[str, ...] = ()

    def units(self, found: Mapping[str, str]) -> Units:
        """Return the units of a file that itself tells of those `found`."""
        said = {"length": self.unit, "force": self.force_unit}
        return Units(**{**found, **{key: name for key, name in said.items() if name is not None}})


def structure_of(content: Content, said: Said, *, source: str, name: str) -> Structure:
    """Return the structure that a foreign file describes.

    Parameters
    ----------
    content
        What a reader found.
    said
        What was said beside it.
    source, name
        Name of the file, for messages, and of the structure where the file has none.

    Raises
    ------
    ModelError
        What it describes cannot be, or something is left to say.
    """
    try:
        units = said.units(content.get("units", {}))
    except ModelError as error:
        raise ModelError(f"{source}: {error}") from None
    members = {key: dict(member) for key, member in content["members"].items()}
    for kind, stiffness in (("strut", said.strut_stiffness), ("cable", said.cable_stiffness)):
        _fill_stiffness(members, kind, stiffness, units, source)
    for key, member in members.items():
        tension = member.pop("tension", None)
        if tension is not None and member.get("rest_length") is None:
            member["rest_length"] = _rest_length(key, member, tension, content, units, source)
    written = {"length": units.length, "force": units.force, "temperature": units.temperature}
    return build(
        {**content, "schema": SCHEMA, "units": written, "members": members}, source=source, name=name
    )


def _fill_stiffness(
    members: dict[str, Content], kind: str, stiffness: Quantity | None, units: Units, source: str
) -> None:
    """Give the stiffness that was said to the members of a kind that have none."""
    without = [
        key
        for key, member in members.items()
        if member.get("kind") == kind and member.get("stiffness") is None and member.get("area") is None
    ]
    if without and stiffness is None:
        raise ModelError(
            f"{source}: found no stiffness of {len(without)} {kind}s (such as {without[0]!r}), expected one "
            f"to be said: --{kind}-stiffness, in Python {kind}_stiffness, which is EA in {units.force}"
        )
    for key in without:
        members[key]["stiffness"] = stiffness


def _rest_length(
    key: str, member: Content, tension: object, content: Content, units: Units, source: str
) -> float:
    """Return the rest length with which a member carries a tension where its nodes are."""
    place = f"{source}: members.{key}"
    try:
        force = units.number(tension, "force")
        if member.get("stiffness") is not None:
            stiffness = units.number(member["stiffness"], "force")
        else:
            modulus = content.get("materials", {}).get(member["material"], {}).get("youngs_modulus")
            stiffness = units.number(modulus, "stress") * units.number(member["area"], "area")
        nodes = {
            node: vector([units.number(value, "length") for value in content["nodes"][node]])
            for node in map(str, member["nodes"])
        }
    except QuantityError as error:
        raise ModelError.at(place, tension, str(error), candidates=error.candidates) from None
    except KeyError as error:
        raise ModelError.at(
            place, str(error.args[0]), "the id of a node", candidates=content["nodes"]
        ) from None
    if not is_number(force) or not -stiffness < force < stiffness:
        raise ModelError.at(place, tension, f"a tension below the stiffness {stiffness:g}")
    return float(law.rest_length_for(path_length(nodes, map(str, member["nodes"])), force, stiffness))
