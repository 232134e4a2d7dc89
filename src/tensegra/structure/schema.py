"""The shape of `tensegra/structure/1`, in pydantic: its keys, and what kind of value each takes.

Numbers are converted here into the units that the file declares. Whether they and the names make a
possible structure is asked in `tensegra.structure.checks`.
"""

from typing import Annotated, Any, cast

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, ValidationInfo
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


Identifier = Annotated[str, BeforeValidator(_identifier)]
Ratio = Annotated[float, _quantity("ratio")]
Length = Annotated[float, _quantity("length")]
Area = Annotated[float, _quantity("area")]
Inertia = Annotated[float, _quantity("second moment of area")]
Force = Annotated[float, _quantity("force")]
Stress = Annotated[float, _quantity("stress")]
Weight = Annotated[float, _quantity("force per volume")]
Temperature = Annotated[float, _quantity("temperature")]
Expansion = Annotated[float, _quantity("thermal expansion")]
Factors = Annotated[tuple[Ratio, Ratio, Ratio], BeforeValidator(_three)]
Position = Annotated[tuple[Length, Length, Length], BeforeValidator(_three)]
Load = Annotated[tuple[Force, Force, Force], BeforeValidator(_three)]


class _Schema(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class UnitsSchema(_Schema):
    """The key `units`."""

    length: str = "m"
    force: str = "N"
    temperature: str = "K"


class MaterialSchema(_Schema):
    """A value of `materials`."""

    youngs_modulus: Stress
    weight: Weight = 0.0
    thermal_expansion: Expansion = 0.0


class MemberSchema(_Schema):
    """A value of `members`."""

    kind: str
    nodes: list[Identifier]
    material: Identifier | None = None
    area: Area | None = None
    stiffness: Force | None = None
    rest_length: Length | None = None
    groups: list[Identifier] = Field(default_factory=list)
    section_inertia: Inertia | None = None
    strength: Force | None = None


class ActuatorSchema(_Schema):
    """A value of `actuators`."""

    members: list[Identifier]
    effect: str


class StageSchema(_Schema):
    """An entry of `stages`."""

    name: Identifier | None = None
    rest_length_changes: dict[str, Ratio] = {}
    rest_lengths: dict[str, Length] = {}
    loads: dict[str, Load] = {}
    temperatures: dict[str, Temperature] = {}
    positions: dict[str, Position] = {}
    gravity: Factors | None = None


class StructureSchema(_Schema):
    """The file, without the keys `schema` and `units`, which are read before it."""

    name: Identifier
    description: str = ""
    nodes: dict[str, Position]
    materials: dict[str, MaterialSchema] = {}
    members: dict[str, MemberSchema]
    supports: dict[str, str] = {}
    gravity: Factors = (0.0, 0.0, 0.0)
    actuators: dict[str, ActuatorSchema] = {}
    stages: list[StageSchema] = []


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
