"""Reference of both file formats, from the JSON Schemas that editors use, too."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tensegra.schemas import schema_text
from tensegra.structure.text import dump_line

__all__ = ["pages"]

Schema = Mapping[str, Any]

TITLES = {
    "MaterialSchema": "materials",
    "MemberSchema": "members",
    "ActuatorSchema": "actuators",
    "StageSchema": "stages",
    "UnitsSchema": "units",
    "VariableEntry": "variables",
    "OutputEntry": "outputs",
    "SolverEntry": "solver",
    "SelectionEntry": "selection",
    "SurrogateEntry": "surrogates",
    "AnalysisEntry": "analyses",
    "DistributionEntry": "distribution",
    "InputLaw": "an entry of `inputs` or `errors`",
    "Coordinate": "a coordinate",
    "Prestress": "a prestress",
    "Factor": "a factor of `product`",
    "Predict": "`predict` of a calibration",
}
"""What a definition is called on a page; a kind in a list is called by its keyword."""

LAWS = (
    *("DistributionEntry", "Uniform", "Normal", "TruncatedNormal", "Lognormal", "Beta", "Triangular"),
    *("Exponential", "Weibull", "Discrete", "Empirical"),
)
SAMPLERS = (
    "Sobol",
    "Halton",
    "LatinHypercube",
    "FullFactorial",
    "Saltelli",
    "Product",
    "Factor",
    "FileDesign",
)
ANALYSES = (
    *("AnalysisEntry", "Propagation", "Sensitivity", "Morris", "Optimisation", "Robust", "Inverse"),
    *("Calibration", "Predict", "InputLaw"),
)

PAGES: Mapping[str, tuple[str, tuple[str, ...], str]] = {
    "variables": ("Variables", ("VariableEntry", "Coordinate", "Prestress"), "What a study can vary."),
    "laws": ("Laws", LAWS, "The distributions that a variable can have."),
    "samplers": ("Samplers", SAMPLERS, "The designs of experiments: which points are run."),
    "outputs": ("Outputs", ("OutputEntry",), "What can be taken from every run."),
    "analyses": ("Analyses", ANALYSES, "The questions that a study can ask."),
}
"""Parts of the study file with a page of their own: title, definitions, first sentence."""


def pages(_folder: Path) -> dict[str, str]:
    """Return the reference pages of both formats, by file name."""
    structure, study = (json.loads(schema_text(name)) for name in ("structure", "study"))
    where = {
        **dict.fromkeys(structure["$defs"], "structure-file.md"),
        **dict.fromkeys(study["$defs"], "study-file.md"),
        **{name: f"{page}.md" for page, (_, names, _) in PAGES.items() for name in names},
    }
    rest = tuple(name for name in study["$defs"] if where[name] == "study-file.md")
    made = {
        "structure-file.md": _format_page(
            "Structure file", structure, tuple(structure["$defs"]), where, _STRUCTURE
        ),
        "study-file.md": _format_page("Study file", study, rest, where, _STUDY),
    }
    for page, (title, names, sentence) in PAGES.items():
        text = f"# {title}\n\n{sentence} All keys are those of the [study file](study-file.md).\n\n"
        made[f"{page}.md"] = text + "\n".join(_definition(name, study, where) for name in names)
    missing = set(study["$defs"]) | set(structure["$defs"])
    missing -= {name for name in missing if any(f"({_anchor(name)})=" in text for text in made.values())}
    if missing:
        raise RuntimeError(f"definitions that stand on no page: {', '.join(sorted(missing))}")
    return made


_STRUCTURE = """\
The format `tensegra/structure/1`, in YAML or JSON. `tensegra new` writes a file with a remark on every
section, `tensegra check FILE` reads one and says what it is, and `tensegra schema structure` prints the
[JSON Schema](../schemas/structure.schema.json) from which this page is made.

A **bold** key must be there. A number with a unit in brackets is in the file's own units; it may also carry
its own, such as `255 mm^2`. Wherever members are named, a group of them may stand, too."""

_STUDY = """\
The format `tensegra/study/1`, in YAML or JSON. `tensegra run FILE` runs it, `tensegra run FILE --dry-run`
says what it would do and how long it takes, and `tensegra schema study` prints the [JSON
Schema](../schemas/study.schema.json) from which this page is made.

A **bold** key must be there. Numbers are in the units of the structure."""


def _format_page(
    title: str, schema: Schema, names: tuple[str, ...], where: Mapping[str, str], intro: str
) -> str:
    parts = [f"# {title}\n\n{intro}\n\n## The file\n\n{_table(schema, schema, where)}"]
    return "\n".join([*parts, *(_definition(name, schema, where) for name in names)])


def _definition(name: str, schema: Schema, where: Mapping[str, str]) -> str:
    entry = schema["$defs"][name]
    text = f"({_anchor(name)})=\n## {_title(name)}\n\n{entry['description']}\n"
    full = (
        entry
        if "properties" in entry
        else next((e for e in entry.get("anyOf", ()) if "properties" in e), None)
    )
    if full is None:
        return f"{text}\n{_type(entry, where)}\n"
    if any(e.get("type") == "array" for e in entry.get("anyOf", ())):
        text += "\nShort: a list of its first parameters, in this order.\n"
    if "oneOf" in full:
        keys = ", ".join(f"`{one['required'][0]}`" for one in full["oneOf"])
        text += f"\nExactly one of {keys}.\n"
    return f"{text}\n{_table(full, schema, where)}"


def _title(name: str) -> str:
    """Return what a definition is called: by its keyword, where it is one of several kinds."""
    if name in TITLES:
        return TITLES[name]
    if name == "FileDesign":
        return "`file`"
    words = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name).strip("_")
    return f"`{words}`"


def _anchor(name: str) -> str:
    return f"def-{name.lower()}"


def _table(entry: Schema, schema: Schema, where: Mapping[str, str]) -> str:
    rows = ["| key | type | default | meaning | example |", "| --- | --- | --- | --- | --- |"]
    required = set(entry.get("required", ()))
    for key, value in entry["properties"].items():
        target = schema["$defs"].get(str(value.get("$ref", "")).removeprefix("#/$defs/"), {})
        name = f"**`{key}`**" if key in required else f"`{key}`"
        kind = _type(value, where)
        if "unit" in value:
            kind += f" [{value['unit']}]" if value["unit"] != "1" else ""
        default = "" if key in required or value.get("default") is None else _code(value["default"])
        meaning = value.get("description") or target.get("description", "")
        example = _code(value["examples"][0]) if value.get("examples") else ""
        cells = (name, kind, default, meaning, example)
        rows.append("| " + " | ".join(cell.replace("|", r"\|").replace("\n", " ") for cell in cells) + " |")
    return ":::{div} keys\n" + "\n".join(rows) + "\n:::\n"


def _several(kind: str) -> str:
    return {"name": "names", "number": "numbers", "whole number": "whole numbers", "text": "texts"}.get(
        kind, kind
    )


def _code(value: object) -> str:
    return f"`{dump_line(value)}`" if value not in ("", [], {}) else "none"


def _type(entry: Schema, where: Mapping[str, str]) -> str:
    """Return the type of a value in words, with links to the definitions."""
    if "$ref" in entry:
        name = entry["$ref"].removeprefix("#/$defs/")
        return f"[{_title(name)}]({where[name]}#{_anchor(name)})"
    if "const" in entry:
        return f"`{dump_line(entry['const'])}`"
    if "enum" in entry:
        return " or ".join(f"`{value}`" for value in entry["enum"])
    for word in ("anyOf", "oneOf"):
        if word in entry:
            parts = [_type(one, where) for one in entry[word] if one.get("type") != "null"]
            return " or ".join(dict.fromkeys(part for part in parts if part))
    return _collection(entry, where) or _plain(entry.get("type", "any value"))


def _collection(entry: Schema, where: Mapping[str, str]) -> str:
    """Return the words for a list or a mapping, none for anything else."""
    if entry.get("type") == "array":
        if "prefixItems" in entry:
            return f"list of {len(entry['prefixItems'])} numbers"
        return f"list of {_several(_type(entry['items'], where))}" if entry.get("items") else "list"
    if entry.get("type") == "object":
        inner = entry.get("additionalProperties")
        return f"mapping: name → {_type(inner, where)}" if isinstance(inner, Mapping) else "mapping"
    return ""


def _plain(kind: str | list[str]) -> str:
    words = {"string": "text", "integer": "whole number", "boolean": "true or false"}
    kinds = [kind] if isinstance(kind, str) else [one for one in kind if one != "null"]
    if set(kinds) == {"number", "string"}:
        return "number or quantity"
    if set(kinds) == {"string", "integer"}:
        return "name"
    return " or ".join(words.get(one, one) for one in kinds)
