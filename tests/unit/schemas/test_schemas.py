"""The JSON Schemas: what they say of every key, and that they agree with the readers of the files."""

import json
from pathlib import Path

import pytest
import yaml

from tensegra.errors import TensegraError
from tensegra.schemas import NAMES, schema_text, starter_structure
from tensegra.schemas.generate import generate
from tensegra.schemas.sources import described_fields
from tensegra.structure import library, parse_structure, structure_to_mapping
from tensegra.structure.schema import StructureSchema
from tensegra.structure.text import load_yaml
from tensegra.study import parse_study
from tensegra.study.schema import StudyFile

ROOT = Path(__file__).parents[3]

SCHEMAS = {name: json.loads(schema_text(name)) for name in NAMES}

WITHOUT_DEFAULT = {("structure", "name")}
"""The name of the file, which no schema can tell."""


def entries(name):
    """Return every key of a format: where it is, its description, whether it must be there."""
    schema = SCHEMAS[name]
    definitions = {name: schema, **schema["$defs"]}
    for place, definition in definitions.items():
        for part in [definition, *definition.get("anyOf", ())]:
            for key, entry in part.get("properties", {}).items():
                yield place, key, entry, key in part.get("required", ())


EVERY = [(name, *entry) for name in NAMES for entry in entries(name)]


def validator(name):
    jsonschema = pytest.importorskip("jsonschema")
    return jsonschema.Draft202012Validator(SCHEMAS[name])


@pytest.mark.parametrize("name", NAMES)
def test_what_is_shipped_and_published_is_what_the_models_say(name):
    text = json.dumps(generate(name), indent=1, ensure_ascii=False) + "\n"
    assert schema_text(name) == text, "python -m tensegra.schemas.generate writes them anew"
    assert (ROOT / "docs" / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8") == text


@pytest.mark.parametrize(
    ("name", "place", "key", "entry", "required"), EVERY, ids=lambda part: str(part)[:30]
)
def test_every_key_is_told_of(name, place, key, entry, required):
    assert entry["description"].endswith("."), (place, key)
    assert len(entry["examples"]) == 1
    assert {"type", "anyOf", "$ref", "const", "enum", "oneOf", "discriminator"} & set(entry)
    assert required or "default" in entry or (name, key) in WITHOUT_DEFAULT
    shape = json.dumps({word: part for word, part in entry.items() if word not in {"examples", "default"}})
    counts = '"integer"' in shape.replace('["string", "integer"]', "")
    if '"number"' in shape or counts:
        assert entry.get("unit"), (place, key)


def test_no_key_of_the_models_is_missing():
    for name, model in (("structure", StructureSchema), ("study", StudyFile)):
        known = {key for place, key, *_ in entries(name) if place == name}
        assert {field.alias or key for key, field in model.model_fields.items()} <= known


@pytest.mark.parametrize("name", NAMES)
def test_examples_are_what_their_own_schema_allows(name):
    jsonschema = pytest.importorskip("jsonschema")
    schema = SCHEMAS[name]
    jsonschema.Draft202012Validator.check_schema(schema)
    for place, key, entry, _ in entries(name):
        within = {**entry, "$defs": schema["$defs"]}
        for example in entry["examples"]:
            errors = list(jsonschema.Draft202012Validator(within).iter_errors(example))
            assert not errors, (place, key, errors[0].message)


def test_the_examples_of_a_study_are_read():
    for example in StudyFile.examples:
        assert parse_study(example).n_points == 256


@pytest.mark.parametrize("name", library.__all__)
def test_files_that_are_read_are_valid(name):
    structure = getattr(library, name)()
    for content in (structure_to_mapping(structure), load_yaml(starter_structure(structure))):
        assert parse_structure(content) == structure
        assert validator("structure").is_valid(json.loads(json.dumps(content)))


@pytest.mark.parametrize("file", ["examples/beam.yaml", "examples/questions.yaml"])
def test_studies_of_the_examples_are_valid(file):
    content = load_yaml((ROOT / file).read_text(encoding="utf-8"))
    assert not list(validator("study").iter_errors(json.loads(json.dumps(content))))


SPOILT = [
    ("structure", ("nodes", "1"), [0, 0]),
    ("structure", ("members", "K1", "knd"), "cable"),
    ("structure", ("members", "K1", "kind"), "rope"),
    ("structure", ("members", "K1", "stiffness"), []),
    ("structure", ("supports", "1"), "xw"),
    ("structure", ("suports",), {}),
    ("structure", ("actuators", "A", "effect"), "pull"),
    ("structure", ("stages",), {}),
    ("study", ("desgn",), {}),
    ("study", ("design", "sampler"), "soboll"),
    ("study", ("design", "sizes"), 0),
    ("study", ("variables", "A14", "distribution"), {"unifrm": [0, 1]}),
    ("study", ("variables", "A14", "distribution"), {"normal": {"mean": 0, "std": -1}}),
    ("study", ("variables", "A14", "distribution"), {"normal": [0, 1], "uniform": [0, 1]}),
    ("study", ("outputs", "w", "displacement"), "up"),
    ("study", ("surrogates", "poly", "kind"), "kriging2"),
    ("study", ("surrogates", "poly", "degre"), 3),
    ("study", ("analyses",), [{"propagation": {}}]),
    ("study", ("analyses",), [{"propagation": {"model": "poly", "confidence": 2}}]),
    ("study", ("seed",), -1),
]


@pytest.mark.parametrize(("name", "place", "value"), SPOILT)
def test_what_a_reader_refuses_an_editor_marks(name, place, value):
    model, read = {
        "structure": (StructureSchema, parse_structure),
        "study": (StudyFile, parse_study),
    }[name]
    content = {"schema": f"tensegra/{name}/1", **json.loads(json.dumps(model.examples[0]))}
    assert validator(name).is_valid(content)
    here = content
    for key in place[:-1]:
        here = here[key]
    here[place[-1]] = value
    assert not validator(name).is_valid(content)
    if place[-1] != "degre":  # an option of a kind is refused when a surrogate of it is fitted
        with pytest.raises(TensegraError):
            read(content)


def test_short_forms_are_valid():
    content = json.loads(json.dumps(StudyFile.examples[0]))
    content["variables"]["A14"]["distribution"] = {"uniform": ["9 %", 0.1]}
    content["analyses"] = [
        {
            "propagation": {
                "model": "poly",
                "inputs": {"A14": 0.1, "A23": {"same_as": "A14"}},
                "limits": {"w": "5 mm"},
            }
        },
        {"calibration": {"model": "poly", "measurements": "measured.csv"}},
    ]
    content["design"] = {"sampler": "latin_hypercube", "sizes": [10, 20]}
    assert not list(validator("study").iter_errors(content))


def test_texts_stand_below_their_fields():
    assert described_fields(StudyFile)["seed"].startswith("Seed of everything")
    with pytest.raises(TensegraError, match="did you mean 'study'"):
        schema_text("studi")


def test_a_published_schema_is_plain_json():
    for file in (ROOT / "docs" / "schemas").iterdir():
        assert yaml.safe_load(file.read_text(encoding="utf-8"))["$schema"].endswith("2020-12/schema")
