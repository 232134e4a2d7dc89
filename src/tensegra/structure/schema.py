"""The shape of `tensegra/structure/1`, in pydantic: its keys, and what kind of value each takes.

Numbers are converted here into the units that the file declares. Whether they and the names make a
possible structure is asked in `tensegra.structure.checks`.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, cast

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

from tensegra.structure.coerce import is_id, name_of
from tensegra.structure.problems import NOTHING, Place, Problem
from tensegra.units import Dimension, QuantityError, Units

__all__ = ["StructureSchema", "UnitsSchema", "problems_of"]


def _expected(phrase: str, candidates: tuple[str, ...] = ()) -> PydanticCustomError:
    return PydanticCustomError("expected", "{phrase}", {"phrase": phrase, "candidates": candidates})


def _units(info: ValidationInfo) -> Units:
    """Return the unit system that validation was started with."""
    return cast("Units", cast("dict[str, object]", info.context)["units"])


def _quantity(dimension: Dimension) -> BeforeValidator:
    def convert(value: object, info: ValidationInfo) -> float:
        if type(value) is float:
            return value
        try:
            return _units(info).number(value, dimension)
        except QuantityError as error:
            raise _expected(str(error), error.candidates) from None

    return BeforeValidator(convert)


def _identifier(value: object) -> object:
    if is_id(value):
        return name_of(value)
    raise _expected("a name: a whole number, or a text on one line")


def _three(value: object) -> object:
    if not isinstance(value, list) or len(value) != 3:
        raise _expected("three numbers [x, y, z]")
    return value


def _unit(dimension: Dimension) -> WithJsonSchema:
    """Tell editors and pages that a number may carry its unit, and what it measures in the file's own."""
    own = {"N": "force", "m": "length", "K": "temperature"}
    unit = re.sub("[NmK]", lambda base: own[base[0]], Units().of(dimension))
    return WithJsonSchema({"type": ["number", "string"], "unit": unit})


Examples = tuple[Mapping[str, Any], ...]

Identifier = Annotated[str, BeforeValidator(_identifier), WithJsonSchema({"type": ["string", "integer"]})]
Ratio = Annotated[float, _quantity("ratio"), _unit("ratio")]
Length = Annotated[float, _quantity("length"), _unit("length")]
Area = Annotated[float, _quantity("area"), _unit("area")]
Inertia = Annotated[float, _quantity("second moment of area"), _unit("second moment of area")]
Force = Annotated[float, _quantity("force"), _unit("force")]
Stress = Annotated[float, _quantity("stress"), _unit("stress")]
Weight = Annotated[float, _quantity("force per volume"), _unit("force per volume")]
Temperature = Annotated[float, _quantity("temperature"), _unit("temperature")]
Expansion = Annotated[float, _quantity("thermal expansion"), _unit("thermal expansion")]
# Which words are known is asked later, with the nearest one at hand.
Kind = Annotated[str, WithJsonSchema({"type": "string", "enum": ["strut", "cable"]})]
Effect = Annotated[str, WithJsonSchema({"type": "string", "enum": ["shorten", "lengthen"]})]
Axes = Annotated[str, WithJsonSchema({"type": "string", "pattern": "^[xyz]{1,3}$"})]
Factors = Annotated[tuple[Ratio, Ratio, Ratio], BeforeValidator(_three)]
Position = Annotated[tuple[Length, Length, Length], BeforeValidator(_three)]
Load = Annotated[tuple[Force, Force, Force], BeforeValidator(_three)]


class _Schema(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    examples: ClassVar[Examples] = ()
    """Contents that are right; between them they have every key."""


class UnitsSchema(_Schema):
    """The key `units`."""

    examples: ClassVar[Examples] = ({"length": "cm", "force": "kN", "temperature": "degC"},)

    length: str = "m"
    """Unit of all lengths, a name that pint knows."""
    force: str = "N"
    """Unit of all forces; stresses, stiffnesses and weights are derived from it and from the length."""
    temperature: str = "K"
    """Unit of temperature differences."""


class MaterialSchema(_Schema):
    """A value of `materials`."""

    examples: ClassVar[Examples] = (
        {"youngs_modulus": "115 GPa", "weight": 7.85e-05, "thermal_expansion": 1.2e-05, "strain_limit": 0.01},
    )

    youngs_modulus: Stress
    """Young's modulus E."""
    weight: Weight = 0.0
    """Weight of a volume, which acts where `gravity` is not zero."""
    thermal_expansion: Expansion = 0.0
    """Strain for each degree of temperature difference."""
    strain_limit: Ratio | None = None
    """Largest strain up to which the linear law is trusted; 5 % where left out."""


class MemberSchema(_Schema):
    """A value of `members`."""

    examples: ClassVar[Examples] = (
        {
            "kind": "cable",
            "nodes": [1, 5, 9],
            "material": "steel",
            "area": 0.5,
            "rest_length": 300,
            "groups": ["top"],
            "strength": 12,
        },
        {"kind": "strut", "nodes": [1, 8], "stiffness": 1000000.0, "rest_length": 141},
        {"kind": "strut", "nodes": [1, 8], "material": "steel", "area": "255 mm^2", "section_inertia": 0.8},
    )

    kind: Kind
    """A strut carries tension and compression, a cable tension only."""
    nodes: list[Identifier]
    """Ids of the nodes in the order of the path. A cable over three or more nodes is clustered: it runs over
    frictionless pulleys with one tension. A closed loop repeats its first node at the end."""
    material: Identifier | None = None
    """Name of the material."""
    area: Area | None = None
    """Cross-section; with the material's modulus it gives the axial stiffness EA."""
    stiffness: Force | None = None
    """Axial stiffness EA itself, in place of an area."""
    rest_length: Length | None = None
    """Length of the whole path free of force; the length along the given nodes if left out."""
    groups: list[Identifier] = Field(default_factory=list)
    """Names under which members are addressed together."""
    section_inertia: Inertia | None = None
    """Second moment of area of a strut, for its buckling load; it needs a material."""
    strength: Force | None = None
    """Largest force that the member may carry; `tensegra check` tells how near it is."""


class ActuatorSchema(_Schema):
    """A value of `actuators`."""

    examples: ClassVar[Examples] = ({"members": ["K1", "K4"], "effect": "shorten"},)

    members: list[Identifier]
    """Ids of members, or names of groups, whose rest lengths change together."""
    effect: Effect
    """Value 0.1 multiplies the rest lengths by 0.9 (shorten) or 1.1 (lengthen)."""


class StageSchema(_Schema):
    """An entry of `stages`."""

    examples: ClassVar[Examples] = (
        {"name": "prestress", "rest_length_changes": {"K1": -0.0255}},
        {
            "name": "more",
            "rest_lengths": {"K1": 295},
            "loads": {"9": [0, 0, -1]},
            "temperatures": {"top": 20},
            "positions": {"1": [0, 0, 1]},
            "gravity": [0, 0, -1],
        },
    )

    name: Identifier | None = None
    """Name of the stage; `stage 1`, `stage 2`, … if left out."""
    rest_length_changes: dict[str, Ratio] = {}
    """Change of rest length relative to the one before the stage, by member or group."""
    rest_lengths: dict[str, Length] = {}
    """New rest length, by member or group."""
    loads: dict[str, Load] = {}
    """Force on a node along x, y and z, by node; it replaces the node's earlier load."""
    temperatures: dict[str, Temperature] = {}
    """Difference from the stress-free state, by member or group."""
    positions: dict[str, Position] = {}
    """New coordinates of a supported node, by node."""
    gravity: Factors | None = None
    """Factor on the members' weights along x, y and z; as before if left out."""


class StructureSchema(_Schema):
    """The file, without the keys `schema` and `units`, which are read before it."""

    examples: ClassVar[Examples] = (
        {
            "name": "rope",
            "description": "Two cables in a line.",
            "nodes": {"1": [0, 0, 0], "2": [1, 0, 0], "3": [2, 0, 0]},
            "materials": {"steel": {"youngs_modulus": "115 GPa"}},
            "members": {
                "K1": {"kind": "cable", "nodes": [1, 2], "stiffness": 100000.0, "rest_length": 0.99},
                "K2": {"kind": "cable", "nodes": [2, 3], "stiffness": 100000.0, "rest_length": 0.99},
            },
            "supports": {"1": "xyz", "2": "yz", "3": "xyz"},
            "gravity": [0, 0, -1],
            "actuators": {"A": {"members": ["K1"], "effect": "shorten"}},
            "stages": [{"name": "load", "loads": {"2": [10, 0, 0]}}],
        },
    )

    name: Identifier
    """Name of the structure, for people; the file's name if left out."""
    description: str = ""
    """What the structure is, for people; no result depends on it."""
    nodes: dict[str, Position]
    """Coordinates x, y and z, by id of the node: where the first equilibrium is sought."""
    materials: dict[str, MaterialSchema] = {}
    """Materials, by name."""
    members: dict[str, MemberSchema]
    """Struts and cables, by id."""
    supports: dict[str, Axes] = {}
    """Axes along which a node is held, such as `xyz` or `z`, by node; none are needed for a body free in
    space."""
    gravity: Factors = (0.0, 0.0, 0.0)
    """Factor on the members' weights along x, y and z: [0, 0, -1] lets them act downwards along z."""
    actuators: dict[str, ActuatorSchema] = {}
    """Devices that change rest lengths after all stages, by name."""
    stages: list[StageSchema] = []
    """Loading history, followed in order; what a stage does not name stays as it was."""


_BELOW: dict[str | int, type[_Schema]] = {
    "units": UnitsSchema,
    "materials": MaterialSchema,
    "members": MemberSchema,
    "actuators": ActuatorSchema,
    "stages": StageSchema,
}

_PHRASES = {
    "model_type": "a mapping of keys to values",
    "dict_type": "a mapping of names to values",
    "list_type": "a list",
    "string_type": "a text",
}


def problems_of(error: ValidationError, root: Place = ()) -> tuple[Problem, ...]:
    """Return the problems that pydantic found, those of unknown keys first: they explain missing ones."""
    details = sorted(error.errors(include_url=False), key=lambda detail: detail["type"] != "extra_forbidden")
    return tuple(_problem((*root, *detail["loc"]), detail) for detail in details)


def _problem(place: Place, detail: Any) -> Problem:  # noqa: ANN401 — pydantic's ErrorDetails, a typed dict
    match detail["type"]:
        case "extra_forbidden":
            keys = _keys_at(place[:-1])
            return Problem(place[:-1], place[-1], f"one of {', '.join(keys)}", keys)
        case "missing":
            return Problem(place, NOTHING, "a value")
        case "expected":
            return Problem(place, detail["input"], detail["ctx"]["phrase"], detail["ctx"]["candidates"])
        case kind:
            return Problem(place, detail["input"], _PHRASES.get(kind, detail["msg"]))


def _keys_at(place: Place) -> tuple[str, ...]:
    if place:
        return tuple(_BELOW[place[0]].model_fields)
    return ("schema", "units", *StructureSchema.model_fields)
