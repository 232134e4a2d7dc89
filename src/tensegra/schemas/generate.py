"""The JSON Schemas of both formats, from the models that read the files.

``python -m tensegra.schemas.generate`` writes them anew, into the package and under ``docs/``. Each key
has its type, unit, default, description and an example. A description is the text below a field, an example
comes from the `examples` of its model, and a unit stands in brackets at the end of a description or, for a
structure, in the field's type.
"""

import inspect
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, get_type_hints

from pydantic import BaseModel, Field, TypeAdapter

from tensegra.schemas.sources import described_fields, described_parameters
from tensegra.structure.mapping import SCHEMA
from tensegra.structure.schema import StructureSchema, UnitsSchema
from tensegra.study.entry import OneOf
from tensegra.study.law_entries import LawEntry
from tensegra.study.models import InputLaw
from tensegra.study.schema import StudyFile
from tensegra.surrogate.auto import TIME_BUDGET
from tensegra.surrogate.kinds import KINDS

__all__ = ["generate", "write"]

Schema = dict[str, Any]

FOLDERS = (Path(__file__).parent, Path(__file__).parents[3] / "docs" / "schemas")

EXAMPLES: Mapping[str, object] = {
    "hidden": [30, 30],
    "adam_batch": 1024,
    "iterations": 100,
    "degree": 4,
    "max_degree": 8,
    "options": {"degree": 3},
    "piece": "gpr",
    "piece_options": {"restarts": 2},
    "time_budget": 60,
}
"""Of options of surrogates that are left to them unless given."""


class StructureFile(StructureSchema):
    """A structure as its file holds it."""

    examples = tuple(
        {"schema": SCHEMA, "units": {"length": "m", "force": "N"}, **example}
        for example in StructureSchema.examples
    )

    schema_: Literal["tensegra/structure/1"] = Field(alias="schema")
    """Format of the file."""
    name: str = Field(default_factory=str)
    """Name of the structure, for people; the file's name if left out."""
    units: UnitsSchema = UnitsSchema()
    """Units of all numbers in the file; metre, newton and kelvin if left out."""


def generate(name: str) -> Schema:
    """Return the JSON Schema of a format, ``structure`` or ``study``."""
    model: type[BaseModel] = StructureFile if name == "structure" else StudyFile
    schema = model.model_json_schema()
    models = {found.__name__: found for found in _models(model)}
    definitions = schema.pop("$defs")
    first = [key for key in ("schema", "name", "description", "units") if key in schema["properties"]]
    schema["properties"] = {key: schema["properties"][key] for key in (*first, *schema["properties"])}
    _complete(schema, model)
    for key, definition in definitions.items():
        _complete(definition, models[key])
    definitions = {key: _with_short_forms(value, models[key]) for key, value in definitions.items()}
    if name == "study":
        definitions["SurrogateEntry"] |= _surrogate_options(definitions["SurrogateEntry"])
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"tensegra/{name}/1",
        "description": _first_line(model),
    }
    return {**head, **{k: v for k, v in schema.items() if k not in head}, "$defs": definitions}


def _models(model: type[BaseModel], seen: set[type[BaseModel]] | None = None) -> Iterator[type[BaseModel]]:
    """Yield a model and all that its fields hold."""
    seen = set() if seen is None else seen
    if model in seen:
        return
    seen.add(model)
    yield model
    for field in model.model_fields.values():
        stack: list[Any] = [field.annotation, *field.metadata]
        while stack:
            part = stack.pop()
            if inspect.isclass(part) and issubclass(part, BaseModel):
                yield from _models(part, seen)
            stack += getattr(part, "__args__", ())
            if hasattr(part, "__origin__"):
                stack.append(part.__origin__)


def _complete(schema: Schema, model: type[BaseModel]) -> None:
    """Give every key its description, unit and example."""
    texts = described_fields(model)
    schema.pop("title", None)
    schema["description"] = _first_line(model)
    for name, field in model.model_fields.items():
        key = field.alias or name
        entry = schema["properties"][key]
        entry.pop("title", None)
        text, unit = re.fullmatch(r"(.*?)(?: \[([^\]]+)\])?", texts[name], re.DOTALL).groups()  # type: ignore[union-attr]
        entry["description"] = text
        _use_standard_words(entry)
        if field.default_factory is not None and key != "name":
            entry["default"] = field.get_default(call_default_factory=True)
        unit = unit or _unit_within(entry)
        if unit is not None:
            entry["unit"] = unit
            if unit != "1" or model.__module__.startswith("tensegra.structure"):
                _allow_quantities(entry)
        entry["examples"] = [example[key] for example in model.examples if key in example][:1]  # type: ignore[attr-defined]
    if issubclass(model, OneOf):
        schema["oneOf"] = [{"required": [key]} for key in model._alternatives()]  # noqa: SLF001 — of one family


def _unit_within(entry: object) -> str | None:
    """Return the unit that a structure's type has, wherever it stands in it."""
    if isinstance(entry, Mapping):
        if isinstance(entry.get("unit"), str):
            return str(entry["unit"])
        return next(filter(None, map(_unit_within, entry.values())), None)
    if isinstance(entry, list):
        return next(filter(None, map(_unit_within, entry)), None)
    return None


def _allow_quantities(entry: Any) -> None:  # noqa: ANN401 — any part of a schema
    """Let every number be a text with a unit, too."""
    if isinstance(entry, dict):
        if entry.get("type") == "number":
            entry["type"] = ["number", "string"]
        for key, value in entry.items():
            if key not in {"default", "examples"}:
                _allow_quantities(value)
    elif isinstance(entry, list):
        for item in entry:
            _allow_quantities(item)


_STANDARD = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def _use_standard_words(entry: Any) -> None:  # noqa: ANN401 — idem
    """Say bounds as JSON Schema does, where pydantic keeps its own words behind a check of ours."""
    if isinstance(entry, dict):
        for word, standard in _STANDARD.items():
            if word in entry:
                entry[standard] = entry.pop(word)
        for key, value in entry.items():
            if key not in {"default", "examples"}:
                _use_standard_words(value)
    elif isinstance(entry, list):
        for item in entry:
            _use_standard_words(item)


def _with_short_forms(schema: Schema, model: type[BaseModel]) -> Schema:
    """Let a law be a list of its first parameters, and an input a number."""
    if issubclass(model, LawEntry):
        short: list[Schema] = [{"type": "array", "minItems": 1, "maxItems": len(model.known_keys())}]
    elif model is InputLaw:
        short = [{"type": ["number", "string"]}]
    elif "measurements" in schema["properties"]:
        # A file in place of its columns.
        columns = schema["properties"]["measurements"]
        inner = {
            key: columns.pop(key)
            for key in ("type", "additionalProperties", "minProperties")
            if key in columns
        }
        columns["anyOf"] = [inner, {"type": "string"}]
        return schema
    else:
        return schema
    return {"description": schema.pop("description"), "anyOf": [schema, *short]}


def _surrogate_options(schema: Schema) -> Schema:
    """Return the options of each kind of surrogate, as its training has them."""
    options: Schema = {}
    for kind, entry in KINDS.items():
        texts = described_parameters(entry.train)
        hints = get_type_hints(entry.train)
        for name, parameter in inspect.signature(entry.train).parameters.items():
            if parameter.kind is parameter.KEYWORD_ONLY:
                option = TypeAdapter(hints[name]).json_schema()
                default = json.loads(json.dumps(parameter.default))
                own = {"description": f"Of {kind}: {texts[name]}", "default": default}
                if "number" in str(option) or "integer" in str(option):
                    own["unit"] = "1"
                own["examples"] = [EXAMPLES[name] if default in (None, []) or name in EXAMPLES else default]
                if name in options:
                    own["description"] = f"{options[name]['description']} {own['description']}"
                    own["default"] = None
                options[name] = {**option, **own}
    options["time_budget"] = {
        "type": "number",
        "description": "Of auto: seconds for the trials of the kinds.",
        "default": TIME_BUDGET,
        "unit": "s",
        "examples": [EXAMPLES["time_budget"]],
    }
    return {"properties": schema["properties"] | options, "additionalProperties": False}


def _first_line(model: type[BaseModel]) -> str:
    return (inspect.getdoc(model) or "").partition("\n\n")[0].replace("\n", " ")


def write() -> None:
    """Write both schemas into the package and under ``docs/``."""
    for name in ("structure", "study"):
        text = json.dumps(generate(name), indent=1, ensure_ascii=False) + "\n"
        for folder in FOLDERS:
            folder.mkdir(exist_ok=True)
            (folder / f"{name}.schema.json").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    write()
