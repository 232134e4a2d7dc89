"""Reading a study: from its file, or from what its file would hold."""

import keyword
import re
from collections.abc import Callable, Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import ModelError, StudyError
from tensegra.structure import Structure, apply_changes, library, parse_structure, read_structure
from tensegra.structure.frozen import FrozenMapping
from tensegra.structure.load import load_values
from tensegra.structure.mapping import SCHEMA as STRUCTURE_SCHEMA
from tensegra.structure.plain import plain
from tensegra.structure.problems import InvalidStructureError
from tensegra.study.derivatives import DIFFERENTIABLE
from tensegra.study.distributions import with_plain_numbers
from tensegra.study.entry import parse_entry
from tensegra.study.measurements import read_columns
from tensegra.study.names import require_known_names
from tensegra.study.outputs import DIMENSIONS as OUTPUT_DIMENSIONS
from tensegra.study.outputs import bind_output
from tensegra.study.points import read_points
from tensegra.study.sampling import FileDesign, require_variables
from tensegra.study.schema import SCHEMA, StudyFile
from tensegra.study.space import Space
from tensegra.study.study import RUN_COLUMNS, Study
from tensegra.study.variables import DIMENSIONS, bind_variable, require_distinct_targets
from tensegra.units import Dimension, QuantityError

__all__ = ["parse_study", "read_study"]

LIBRARY = "library:"
"""Beginning of a reference to a built-in structure."""


def read_study(path: str | PathLike[str]) -> Study:
    """Read a study from a YAML or JSON file, ``tensegra/study/1``.

    Raises
    ------
    StudyError
        If the file cannot be read or the study cannot be carried out; the message gives the place,
        what was found, what was expected and the nearest known name.
    """
    path = Path(path)
    if str(path).startswith(LIBRARY):
        raise StudyError.at(str(path), "a structure", f"a study; `tensegra solve {path}` solves it")
    written = load_values(path, StudyError)
    content = _plain_content(written, f"{path.name}:")
    if "schema" not in content:
        raise StudyError(f"{path.name}: the key 'schema' is missing, expected {SCHEMA!r}")
    if content["schema"] == STRUCTURE_SCHEMA:
        raise StudyError.at(
            path.name, "a structure", f"a study; `tensegra solve {path}` solves the structure"
        )
    return _build(content, source=f"{path.name}:", folder=path.parent, name=path.stem)


def parse_study(content: Mapping[str, Any], folder: str | PathLike[str] = ".") -> Study:
    """Build a study from the content of a study file; the key `schema` may be left out.

    Parameters
    ----------
    content
        As a YAML or JSON reader returns it.
    folder
        What the names of files are relative to.

    Raises
    ------
    StudyError
        As for `read_study`.
    """
    copied = _plain_content(content, "study:")
    return _build({"schema": SCHEMA, **copied}, source="study:", folder=Path(folder), name="study")


def _plain_content(written: object, source: str) -> dict[str, Any]:
    try:
        return plain(written)
    except InvalidStructureError as error:
        problem = error.problems[0]
        place = " ".join([source, ".".join(map(str, problem.place))]).strip().rstrip(":")
        raise StudyError.at(place, problem.found, problem.expected) from None


def _build(content: dict[str, Any], *, source: str, folder: Path, name: str) -> Study:
    structure = _structure(content, source, folder)
    file = parse_entry(StudyFile, _plain_laws(content, structure, source, folder), source)
    for names in (file.variables, file.outputs):
        _require_names(names, file, source)
    variables = {
        key: bind_variable(key, entry, structure, f"{source} variables.{key}")
        for key, entry in file.variables.items()
    }
    require_distinct_targets(variables, structure, f"{source} variables")
    outputs = tuple(
        bind_output(key, entry, structure, f"{source} outputs.{key}") for key, entry in file.outputs.items()
    )
    if file.derivatives and not any(output.quantity in DIFFERENTIABLE for output in outputs):
        expected = f"an output that has derivatives ({', '.join(DIFFERENTIABLE)})"
        raise StudyError.at(f"{source} outputs", [output.quantity for output in outputs], expected)
    require_known_names(file.surrogates, file.analyses, tuple(variables), tuple(file.outputs), source)
    try:
        space = Space(tuple(variables.values()), _matrix(file.correlation))
    except StudyError as error:
        raise StudyError(f"{source} {error}") from None
    points = None
    if isinstance(file.design, FileDesign):
        points = read_points(folder / file.design.file, space.variables, structure, f"{source} design.file")
    else:
        require_variables(file.design, space.names, f"{source} design")
    return Study(
        name=file.name or name,
        structure=structure,
        space=space,
        outputs=outputs,
        design=file.design,
        solver=file.solver,
        derivatives=file.derivatives,
        points=points,
        seed=file.seed,
        selection=file.selection,
        surrogates=FrozenMapping(file.surrogates),
        analyses=file.analyses,
        description=file.description,
    )


def _structure(content: Mapping[str, Any], source: str, folder: Path) -> Structure:
    """Return the structure of a study file, changes applied; faults of form are left to the schema."""
    reference, changes = content.get("structure"), content.get("changes")
    if not isinstance(reference, str | Mapping) or not reference:
        return _refuse_form(content, source)
    try:
        if isinstance(reference, Mapping):
            structure = parse_structure(reference)
        elif reference.startswith(LIBRARY):
            structure = _library_structure(reference, source)
        else:
            structure = read_structure(folder / reference)
        return apply_changes(structure, changes) if isinstance(changes, Mapping) and changes else structure
    except ModelError as error:
        place = "" if str(error).startswith("changes") else " structure:"
        raise StudyError(f"{source}{place} {error}") from None


def _refuse_form(content: Mapping[str, Any], source: str) -> NoReturn:
    """Raise the schema's error for a file that does not even have a structure."""
    parse_entry(StudyFile, content, source)
    raise StudyError(f"{source} structure: expected the name of a file, or a structure")


def _library_structure(reference: str, source: str) -> Structure:
    name = reference.removeprefix(LIBRARY)
    if name not in library.__all__:
        expected = f"one of {', '.join(library.__all__)}"
        raise StudyError.at(f"{source} structure", name, expected, candidates=library.__all__)
    structure: Structure = getattr(library, name)()
    return structure


def _plain_laws(content: dict[str, Any], structure: Structure, source: str, folder: Path) -> dict[str, Any]:
    """Return the content with every distribution in plain numbers of its variable's unit."""
    variables = content.get("variables")
    if not isinstance(variables, Mapping):
        return content
    converters: dict[str, Callable[[object, str], object]] = {}
    for name, entry in variables.items():
        kind = next((key for key in entry if key in DIMENSIONS), None) if isinstance(entry, Mapping) else None
        if kind is not None:
            converters[name] = _converter(kind, structure, folder)

    def converted(name: str, law: object, place: str) -> object:
        return converters[name](law, place) if name in converters else law

    content = dict(content)
    content["variables"] = {
        name: {
            **entry,
            "distribution": converted(name, entry["distribution"], f"{source} variables.{name}.distribution"),
        }
        if isinstance(entry, Mapping) and "distribution" in entry
        else entry
        for name, entry in variables.items()
    }
    if isinstance(content.get("analyses"), list):
        numbers = _dimensions(content)
        content["analyses"] = [
            _plain_quantities(
                _plain_analysis(entry, converted, folder, f"{source} analyses[{i}]"),
                numbers,
                structure,
                f"{source} analyses[{i}]",
            )
            for i, entry in enumerate(content["analyses"])
        ]
    return content


def _dimensions(content: Mapping[str, Any]) -> dict[str, Dimension]:
    """Return what each variable and each output measures, as far as their entries are sound."""
    found: dict[str, Dimension] = {}
    for section, dimensions in (("variables", DIMENSIONS), ("outputs", OUTPUT_DIMENSIONS)):
        entries = content.get(section)
        for name, entry in entries.items() if isinstance(entries, Mapping) else ():
            kinds = [key for key in entry if key in dimensions] if isinstance(entry, Mapping) else []
            if kinds:
                found[name] = dimensions[kinds[0]]
    return found


QUANTITIES = ("bounds", "inputs", "errors", "targets", "limits", "tolerance", "measurements")
"""Keys of an analysis under which names of variables and outputs stand with numbers in their units."""


def _plain_quantities(
    entry: object, dimensions: Mapping[str, Dimension], structure: Structure, place: str
) -> object:
    """Return an analysis with quantities such as ``"5 mm"`` as numbers in the structure's units."""
    if not isinstance(entry, Mapping) or len(entry) != 1:
        return entry
    ((kind, analysis),) = entry.items()
    if not isinstance(analysis, Mapping):
        return entry
    changed = dict(analysis)
    for key in QUANTITIES:
        if isinstance(analysis.get(key), Mapping):
            changed[key] = {
                name: _plain_numbers(value, dimensions.get(name), structure, f"{place}.{kind}.{key}.{name}")
                for name, value in analysis[key].items()
            }
    if isinstance(analysis.get("predict"), Mapping):
        predicted = _plain_quantities(
            {"predict": analysis["predict"]}, dimensions, structure, f"{place}.{kind}"
        )
        changed |= cast("dict[str, Any]", predicted)
    return {kind: changed}


def _plain_numbers(value: object, dimension: Dimension | None, structure: Structure, place: str) -> object:
    """Return a number, or a list of them, without units; what is none is left for the schema to refuse."""
    if dimension is None:
        return value
    if isinstance(value, list):
        return [_plain_numbers(item, dimension, structure, f"{place}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, Mapping) and set(value) == {"fixed"}:
        return {"fixed": _plain_numbers(value["fixed"], dimension, structure, f"{place}.fixed")}
    if not isinstance(value, str):
        return value
    try:
        return structure.units.number(value, dimension)
    except QuantityError as error:
        raise StudyError.at(place, value, str(error), candidates=error.candidates) from None


def _converter(kind: str, structure: Structure, folder: Path) -> Callable[[object, str], object]:
    def number(value: object) -> float:
        return structure.units.number(value, DIMENSIONS[kind])

    return lambda law, place: with_plain_numbers(law, number, folder, place)


def _plain_analysis(
    entry: object, converted: Callable[[str, object, str], object], folder: Path, place: str
) -> object:
    """Return an analysis with laws in plain numbers, and measurements read in."""
    if not isinstance(entry, Mapping) or len(entry) != 1:
        return entry
    ((kind, analysis),) = entry.items()
    if not isinstance(analysis, Mapping):
        return entry
    changed = dict(analysis)
    for key in ("inputs", "errors"):
        changed |= _plain_inputs(analysis, key, converted, f"{place}.{kind}")
    if isinstance(analysis.get("predict"), Mapping):
        predict = analysis["predict"]
        plain = _plain_inputs(predict, "inputs", converted, f"{place}.{kind}.predict")
        changed["predict"] = {**predict, **plain}
    if isinstance(analysis.get("measurements"), str):
        where = f"{place}.{kind}.measurements"
        changed["measurements"] = read_columns(folder / analysis["measurements"], where)
    return {kind: changed}


def _plain_inputs(
    analysis: Mapping[str, Any], key: str, converted: Callable[[str, object, str], object], place: str
) -> dict[str, object]:
    laws = analysis.get(key)
    if not isinstance(laws, Mapping):
        return {}
    return {key: {name: converted(name, law, f"{place}.{key}.{name}") for name, law in laws.items()}}


def _require_names(names: Iterable[str], file: StudyFile, source: str) -> None:
    """Refuse names that cannot be columns, or stand in an expression."""
    section = "variables" if names is file.variables else "outputs"
    for name in names:
        place = f"{source} {section}"
        if not re.fullmatch(r"[^\W\d]\w*", name) or keyword.iskeyword(name):
            raise StudyError.at(place, name, "a name of letters, digits and underscores")
        if name in RUN_COLUMNS:
            raise StudyError.at(place, name, "another name: every campaign has a column of this one")
        if section == "outputs" and name in file.variables:
            raise StudyError.at(place, name, "another name: a variable has this one")


def _matrix(rows: tuple[tuple[float, ...], ...] | None) -> NDArray[np.float64] | None:
    if rows is None:
        return None
    if any(len(row) != len(rows) for row in rows):
        raise StudyError.at("correlation", [len(row) for row in rows], "rows as long as there are rows")
    return np.array(rows, dtype=np.float64)
