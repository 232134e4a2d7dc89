"""What all entries of a study file share: strict types, known keys, one readable message.

The entries of the file are pydantic models, each beside the code that gives it its meaning
(`distributions`, `variables`, `outputs`, `sampling`, `selection`, `analyses`); `schema` puts them
together.
"""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, ClassVar, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from tensegra.errors import StudyError
from tensegra.units import LARGEST, SMALLEST, is_sane

__all__ = ["Count", "Entry", "Examples", "Flag", "Identifier", "Number", "OneOf", "Positive", "parse_entry"]


def _identifier(value: object) -> object:
    """Let an integer stand for a name, as node and member ids are often numbers."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _sane(value: float) -> float:
    if not is_sane(value):
        raise ValueError(f"found {value:g}, expected 0, or a number from {SMALLEST:g} to {LARGEST:g} in size")
    return value


Number = Annotated[float, Strict(), Field(allow_inf_nan=False), AfterValidator(_sane)]
Positive = Annotated[Number, Field(gt=0)]
Count = Annotated[int, Strict(), Field(ge=1)]
Flag = Annotated[bool, Strict()]
Identifier = Annotated[
    str,
    Field(min_length=1),
    BeforeValidator(_identifier),
    WithJsonSchema({"type": ["string", "integer"], "minLength": 1}),
]

Examples = tuple[Mapping[str, Any], ...]

EntryType = TypeVar("EntryType", bound="Entry")


class Entry(BaseModel):
    """A mapping of the study file whose keys are all known."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)

    examples: ClassVar[Examples] = ()
    """Contents that are right; between them they have every key."""

    @classmethod
    def known_keys(cls) -> list[str]:
        """Return the keys as they are written in the file."""
        return [field.alias or name for name, field in cls.model_fields.items()]

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, data: Any) -> Any:  # noqa: ANN401 - pydantic hands over what the file holds
        if isinstance(data, Mapping):
            for key in data:
                if key not in cls.known_keys() and key not in cls.model_fields:
                    raise PydanticCustomError(
                        "unknown_key", "an unknown key", {"key": str(key), "known": cls.known_keys()}
                    )
        return data

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """Leave out of the repr what was not written."""
        return [(name, value) for name, value in super().__repr_args__() if value is not None]

    def written(self) -> dict[str, Any]:
        """Return the entry as plain data, everything explicit, as a study file would hold it."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)


class OneOf(Entry):
    """A mapping with exactly one of its alternatives, such as ``{normal: …}``; see `_alternatives`."""

    @classmethod
    def _alternatives(cls) -> list[str]:
        """Return the keys of which exactly one has to be there; all of them, if not overridden."""
        return cls.known_keys()

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        alternatives = self._alternatives()
        chosen = [key for key in alternatives if getattr(self, key) is not None]
        if len(chosen) != 1:
            raise PydanticCustomError("one_of", "exactly one", {"chosen": chosen, "known": alternatives})
        return self

    @property
    def kind(self) -> str:
        """The alternative that was chosen."""
        return next(key for key in self._alternatives() if getattr(self, key) is not None)

    @property
    def value(self) -> Any:  # noqa: ANN401 - the type depends on the alternative
        """What the chosen alternative holds."""
        return getattr(self, self.kind)


def parse_entry(model: type[EntryType], data: object, place: str) -> EntryType:
    """Validate plain data against an entry of the study file.

    Parameters
    ----------
    model
        The entry's class.
    data
        Mappings, lists and scalars as a YAML or JSON reader returns them.
    place
        Where the data stand, the beginning of every message: a file or a path of keys.

    Raises
    ------
    StudyError
        With the first fault: its place, what was found, what was expected, the nearest known name.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise _study_error(error.errors()[0], data, place) from None


def _study_error(fault: ErrorDetails, data: object, place: str) -> StudyError:
    separator = " " if place.endswith(":") else "."
    path = _path_of_keys(fault["loc"], data, is_missing=fault["type"] == "missing")
    where = f"{place}{separator}{path}" if path else place.rstrip(":")
    context = fault.get("ctx", {})
    match fault["type"]:
        case "unknown_key":
            known = context["known"]
            return StudyError.at(where, context["key"], "one of " + ", ".join(known), candidates=known)
        case "one_of":
            found, known = context["chosen"], context["known"]
            return StudyError.at(where, found or "none of them", "exactly one of " + ", ".join(known))
        case "missing":
            return StudyError(f"{where}: the key is missing")
        case "union_tag_invalid" | "literal_error" | "union_tag_not_found":
            return _unknown_choice(fault, where)
        case "value_error":
            return StudyError(f"{where}: {context['error']}")
    return StudyError.at(where, fault["input"], _expectation(fault))


def _expectation(fault: ErrorDetails) -> str:
    """Return what a value should have been, from pydantic's sentence about it."""
    if fault["type"] in {"model_type", "dict_type", "model_attributes_type"}:
        return "a mapping"
    if fault["type"] in {"tuple_type", "list_type"}:
        return "a list"
    expected = fault["msg"].removeprefix("Input should be ").removeprefix("a valid ")
    bound = "a number " if expected.startswith(("greater", "less")) else ""
    article = "a " if fault["msg"].startswith("Input should be a valid ") else ""
    return f"{bound}{article}{expected[:1].lower()}{expected[1:]}"


def _unknown_choice(fault: ErrorDetails, where: str) -> StudyError:
    context = fault.get("ctx", {})
    choices = str(context.get("expected_tags") or context.get("expected") or "")
    names = [name.strip(" '") for name in choices.replace(" or ", ", ").split(",") if name.strip()]
    if fault["type"] == "literal_error":
        return StudyError.at(where, fault["input"], "one of " + ", ".join(names), candidates=names)
    discriminator = str(context["discriminator"]).strip("'")
    if fault["type"] == "union_tag_not_found":
        return StudyError(f"{where}: the key {discriminator!r} is missing")
    return StudyError.at(
        f"{where}.{discriminator}", context["tag"], "one of " + ", ".join(names), candidates=names
    )


def _path_of_keys(location: tuple[int | str, ...], data: object, *, is_missing: bool = False) -> str:
    """Write a pydantic location as a path of keys, without the names of union members.

    The last key is in the data only if it is not the one that `is_missing`.

    Examples
    --------
    >>> _path_of_keys(("nodes", 1), {"nodes": [18, "x"]})
    'nodes[1]'
    >>> _path_of_keys(("design", "sobol", "sizes"), {"design": {"sampler": "sobol", "sizes": -1}})
    'design.sizes'
    """
    path = ""
    here = data
    for depth, key in enumerate(location):
        if isinstance(key, int) and isinstance(here, list | tuple):
            path += f"[{key}]"
            here = here[key] if key < len(here) else None
        elif isinstance(here, Mapping):
            if key in here or (is_missing and depth == len(location) - 1):
                path += f".{key}" if path else str(key)
                here = here.get(key)
        elif depth == len(location) - 1:
            # A parameter that was given by its position in a list.
            path += f".{key}"
    return path
