"""Values and files that a program should never see, and the strategies that make them from our schemas."""

import copy
import json

from hypothesis import strategies as st

from tensegra.structure.schema import StructureSchema, UnitsSchema
from tensegra.study.schema import StudyFile

STRUCTURE = {
    "schema": "tensegra/structure/1",
    "name": "tripod",
    "units": {"length": "cm", "force": "kN", "temperature": "degC"},
    "nodes": {"1": [0, 0, 0], "2": [100, 0, 0], "3": [0, 100, 0], "4": [30, 30, 80]},
    "materials": {"m": {"youngs_modulus": "115 GPa", "weight": 7.85e-5, "thermal_expansion": 1.6e-5}},
    "members": {
        "K1": {"kind": "cable", "nodes": [1, 4, 2], "material": "m", "area": 0.5, "groups": ["top"]},
        "K2": {"kind": "cable", "nodes": [3, 4], "material": "m", "area": "50 mm^2", "groups": ["top"]},
        "s1": {"kind": "strut", "nodes": [1, 2], "stiffness": 1e6},
    },
    "supports": {"1": "xyz", "2": "xyz", "3": "xyz"},
    "gravity": [0, 0, -1],
    "actuators": {"A": {"members": ["K1"], "effect": "shorten"}},
    "stages": [
        {"name": "prestress", "rest_length_changes": {"K1": -0.02, "K2": -0.03}},
        {"name": "load", "loads": {"4": [0, 0, -1]}, "temperatures": {"top": 20}, "rest_lengths": {"K2": 80}},
    ],
}
STUDY = {
    "schema": "tensegra/study/1",
    "structure": {key: value for key, value in STRUCTURE.items() if key != "schema"},
    "seed": 1,
    "variables": {
        "A": {"actuator": "A", "distribution": {"uniform": [0.0, 0.05]}},
        "T": {"temperature": "top", "distribution": {"truncated_normal": [10, 5, 0, 30]}},
        "E": {"youngs_modulus": "m", "distribution": {"lognormal": {"mean": "110 GPa", "std": 200}}},
    },
    "outputs": {
        "w": {"displacement": "z", "nodes": ["4"]},
        "F": {"max_tension": "top"},
        "slack": {"slack_cables": "all"},
    },
    "design": {"sampler": "sobol", "sizes": [4, 4]},
    "selection": {"method": "certificate"},
    "surrogates": {"p": {"kind": "pce", "degree": 1, "outputs": ["w", "F"]}},
    "analyses": [
        {"propagation": {"model": "p", "samples": 16, "quantiles": [0.5], "limits": {"w": 0.1}}},
        {"sensitivity": {"model": "p", "samples": 16}},
        {"morris": {"model": "p", "trajectories": 4}},
        {"optimisation": {"model": "p", "objective": "w/(abs(F)+1)", "constraints": ["F <= 9"],
                          "methods": ["slsqp"], "starts": 2}},
        {"inverse": {"model": "p", "targets": {"w": 0.1}, "starts": 2, "samples": 4}},
    ],
}  # fmt: skip

NAMES = ["1", "2", "4", "K1", "s1", "top", "m", "A", "T", "E", "w", "F", "p", "x", "z", "xyz", "load", "all"]
"""Names that the files above know, so that what is drawn is often sound."""

ODD = st.sampled_from([
    None, True, False, 0, -1, 1, 2**63, -(2**63), 10**400, 0.0, -0.0, 1e-320, 5e-324, -1e308, 1e308,
    1e300, 1e-300,
    float("inf"), float("-inf"), float("nan"), "", " ", "\0", "a\nb", "\u2028", "é", "💥", "x" * 5000,
    "1e99999999999 m",
    "1 cm^0", "1 m^-9", "nan m", "1 m m m m", "-5 kN", "1 furlong", "1 degC", "5 %", "../../x", "/etc/passwd",
    "con", "a/b", [], {}, [[]], [[], [1]], {"": 1}, {"a": {"a": {"a": {}}}}, [0, 0, 0], [1, 2], ["1", "1"],
    "__import__('os')", "w" + "+w" * 300, "(" * 100 + "w" + ")" * 100, "w**w**w**w", "1/0",
    "w <= 1 <= 2", "-" * 90 + "w",
])  # fmt: skip


def schema_strategy(schema, root=None, depth=0):
    """Return a strategy for what a JSON schema describes, with something odd here and there."""
    root = schema if root is None else root
    if "$ref" in schema:
        return schema_strategy(root["$defs"][schema["$ref"].rpartition("/")[2]], root, depth)
    sound = _sound(schema, root, depth)
    return st.integers(0, 11).flatmap(lambda n: ODD if n == 0 else sound)


def _sound(schema, root, depth):
    """Return a strategy for what a JSON schema describes, on the first level."""
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return st.one_of([schema_strategy(each, root, depth) for each in schema[key]])
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    if isinstance(schema.get("type"), list):
        return st.one_of([_sound({**schema, "type": each}, root, depth) for each in schema["type"]])
    if schema.get("type") in {"object", "array"}:
        below = _objects if schema["type"] == "object" else _arrays
        return below(schema, root, depth) if depth <= DEEPEST else st.just({} if below is _objects else [])
    return _SCALARS.get(schema.get("type"), st.sampled_from(NAMES) | st.integers(-2, 40))


DEEPEST = 5
"""Levels of what is drawn: as many as a study has."""

_SCALARS = {
    "string": st.sampled_from(NAMES) | st.text(max_size=3),
    "integer": st.integers(-1, 40),
    "number": st.sampled_from([0.0, 1e-3, 0.5, 1.0, 3.0, 80.0, -1.0]) | st.floats(-1e3, 1e3),
    "boolean": st.booleans(),
    "null": st.none(),
}


def _arrays(schema, root, depth):
    parts = schema.get("prefixItems")
    if parts:
        return st.tuples(*[schema_strategy(each, root, depth + 1) for each in parts]).map(list)
    return st.lists(schema_strategy(schema.get("items") or {}, root, depth + 1), max_size=3)


def _objects(schema, root, depth):
    keys = schema.get("properties", {})
    if not keys:
        values = schema.get("additionalProperties")
        below = schema_strategy(values, root, depth + 1) if isinstance(values, dict) else ODD
        return st.dictionaries(st.sampled_from(NAMES), below, max_size=3)
    needed = set(schema.get("required", ()))
    drawn = {key: schema_strategy(each, root, depth + 1) for key, each in keys.items()}
    return st.fixed_dictionaries(
        {key: value for key, value in drawn.items() if key in needed},
        optional={key: value for key, value in drawn.items() if key not in needed},
    )


structures = schema_strategy(StructureSchema.model_json_schema()).map(
    lambda drawn: {"schema": "tensegra/structure/1", **drawn} if isinstance(drawn, dict) else drawn
)
units = schema_strategy(UnitsSchema.model_json_schema())
studies = schema_strategy(StudyFile.model_json_schema(by_alias=True))

_PARTS = {
    "tensegra/structure/1": StructureSchema.model_json_schema(),
    "tensegra/study/1": StudyFile.model_json_schema(by_alias=True),
}


@st.composite
def spoilt(draw, base):
    """Draw a sound file with one to three of its values exchanged, left out or doubled."""
    content = copy.deepcopy(base)
    definitions = _PARTS[base["schema"]]
    parts = [schema_strategy(each, definitions) for each in definitions["$defs"].values()]
    for _ in range(draw(st.integers(1, 3))):
        *above, last = draw(st.sampled_from(places(content)))
        target = content
        for key in above:
            target = target[key]
        match draw(st.integers(0, 5)):
            case 0 if isinstance(target, dict):
                del target[last]
            case 1 if isinstance(target, list):
                target.append(copy.deepcopy(target[last]))
            case 2 if isinstance(target, dict):
                target[draw(st.sampled_from(NAMES) | st.text(max_size=4))] = target.pop(last)
            case 3:
                target[last] = copy.deepcopy(draw(st.one_of(parts)))
            case 4 if _can_be_scaled(target[last]):
                factors = st.sampled_from([0, -1, 1e3, 1e6, 1e12, 1e-3, 1e-6, 1e-12, 1e90, 1e-90])
                target[last] *= draw(factors)
            case _:
                target[last] = copy.deepcopy(draw(ODD))  # which the next change may spoil in turn
    return content


def _can_be_scaled(value):
    """Whether a value is a number, and not one of those that no float holds."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def places(value, place=()):
    """Return the places of all values inside mappings and lists."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, item in inside for found in ((*place, key), *places(item, (*place, key)))]


@st.composite
def spoilt_texts(draw, base):
    """Draw the text of a sound file with some letters exchanged, left out or repeated."""
    text = json.dumps(base, indent=1) if draw(st.booleans()) else json.dumps(base)
    signs = st.sampled_from(
        [*"[]{},:\"'-#&*!|>%@`~?\t\n 0eE.", "\0", "\ufeff", "&a ", "*a", "<<: ", "!!bool ", "- "]
    )
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(text) - 1))
        length = draw(st.integers(0, 5))
        text = text[:at] + draw(signs) * draw(st.integers(0, 3)) + text[at + length :]
    return text
