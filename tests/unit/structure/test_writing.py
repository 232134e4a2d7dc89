from itertools import pairwise
from math import dist

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tensegra.errors import ModelError
from tensegra.structure import (
    Actuator,
    Material,
    Member,
    Stage,
    Structure,
    Units,
    library,
    read_structure,
    write_structure,
)
from tensegra.units import LARGEST, SMALLEST, is_sane

SUFFIXES = (".yaml", ".yml", ".json")

positive = st.floats(SMALLEST, LARGEST)
factors = st.floats(-1e12, 1e12).filter(is_sane)
vectors = st.tuples(factors, factors, factors)
# Texts that YAML could take for something else come up often enough to be found.
awkward = st.sampled_from(
    ["1e6", "010", "no", "1:30", "null", "~", "<<", "a: b", "#1", "2024-01-01", ".inf", "-", "two words"]
)
names = awkward | st.text(st.characters(codec="utf-8", categories="LMNPS"), min_size=1)


@st.composite
def structures(draw):
    """Draw a chain of members over distinct nodes, with whatever else a structure may have."""
    nodes = draw(st.lists(names, min_size=2, max_size=5, unique=True))
    positions = draw(st.lists(vectors, min_size=len(nodes), max_size=len(nodes), unique=True))
    materials = draw(
        st.dictionaries(
            names,
            st.builds(
                Material, positive, st.floats(0, 1e9).filter(is_sane), st.floats(-1e-6, 1e-6).filter(is_sane)
            ),
            min_size=1,
        )
    )
    paths = [*pairwise(nodes), tuple(nodes)]
    ids = draw(st.lists(names, min_size=len(paths), max_size=len(paths), unique=True))
    groups = st.lists(names.map("all {}".format), max_size=2, unique=True)
    members = {}
    for member_id, path in zip(ids, paths, strict=True):
        kind = "strut" if len(path) == 2 and draw(st.booleans()) else "cable"
        material = draw(st.sampled_from(sorted(materials)))
        section = draw(
            st.fixed_dictionaries({"material": st.just(material), "area": positive})
            | st.fixed_dictionaries({"stiffness": positive}, optional={"material": st.just(material)})
        )
        if kind == "strut" and "material" in section:
            section["section_inertia"] = draw(st.none() | positive)
        along = sum(dist(*ends) for ends in pairwise(positions[nodes.index(node)] for node in path))
        rest_length = along * draw(st.floats(0.01, 100.0))
        members[member_id] = Member(
            kind, path, rest_length, groups=draw(groups), strength=draw(st.none() | positive), **section
        )
    begins_with = {member_id: member.rest_length for member_id, member in members.items()}
    changed = draw(st.lists(st.sampled_from(ids), max_size=2, unique=True))
    member_numbers = st.fixed_dictionaries(
        {member_id: st.floats(0.01, 100.0).map(begins_with[member_id].__mul__) for member_id in changed}
    )
    stage = st.builds(
        Stage,
        name=names,
        rest_lengths=member_numbers,
        loads=st.dictionaries(st.sampled_from(nodes), vectors, max_size=2),
        temperatures=st.dictionaries(st.sampled_from(ids), st.floats(-100, 100).filter(is_sane), max_size=2),
        positions=st.just({nodes[0]: draw(vectors)}),
        gravity=st.none() | vectors,
    )
    actuated = st.lists(st.sampled_from(ids), min_size=1, unique=True)
    return Structure(
        name=draw(names),
        description=draw(st.text(st.characters(codec="utf-8") | st.sampled_from("\n\r\t\x85\u2028\u2029 "))),
        units=draw(st.sampled_from([Units(), Units("cm", "kN", "degC"), Units("ft", "lbf", "degF")])),
        nodes=dict(zip(nodes, positions, strict=True)),
        materials=materials,
        members=members,
        supports={nodes[0]: "xyz", nodes[1]: draw(st.sampled_from(["x", "yz", "xyz"]))},
        gravity=draw(vectors),
        actuators=draw(
            st.dictionaries(
                names, st.builds(Actuator, actuated, st.sampled_from(["shorten", "lengthen"])), max_size=2
            )
        ),
        stages=draw(st.lists(stage, max_size=2, unique_by=lambda stage: stage.name)),
    )


@given(structure=structures(), suffix=st.sampled_from(SUFFIXES))
@settings(max_examples=75, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_written_is_read_back_equal(structure, suffix, tmp_path):
    path = tmp_path / f"structure{suffix}"
    write_structure(structure, path)
    again = read_structure(path)
    assert again == structure
    assert again.fingerprint == structure.fingerprint


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_beam_survives_every_format(suffix, tmp_path):
    write_structure(library.paper_beam(), tmp_path / f"beam{suffix}")
    assert read_structure(tmp_path / f"beam{suffix}") == library.paper_beam()


def test_yaml_is_written_for_people(rope, tmp_path):
    write_structure(rope, tmp_path / "rope.yaml")
    assert (tmp_path / "rope.yaml").read_text(encoding="utf-8") == (
        "schema: tensegra/structure/1\n"
        "name: rope\n"
        "units: {length: m, force: N, temperature: K}\n"
        "nodes:\n"
        "  '1': [0.0, 0.0, 0.0]\n"
        "  '2': [3.0, 4.0, 0.0]\n"
        "members:\n"
        "  K1:\n"
        "    kind: cable\n"
        "    nodes: ['1', '2']\n"
        "    stiffness: 1000.0\n"
        "    rest_length: 5.0\n"
        "supports: {'1': xyz, '2': yz}\n"
    )


def test_a_failed_write_leaves_the_old_file_and_no_draft(rope, tmp_path, monkeypatch):
    path = tmp_path / "rope.json"
    path.write_text("the old file", encoding="utf-8")

    def no_space(*_args, **_kwargs):
        message = "no space left on device"
        raise OSError(message)

    monkeypatch.setattr("pathlib.Path.replace", no_space)
    with pytest.raises(ModelError, match=r"rope\.json: cannot be written .no space left on device."):
        write_structure(rope, path)
    assert path.read_text(encoding="utf-8") == "the old file"
    assert list(tmp_path.iterdir()) == [path]


def test_a_name_without_a_format_is_refused(rope, tmp_path):
    with pytest.raises(ModelError, match=r"rope\.yam: found '\.yam', .*did you mean '\.yaml'\?"):
        write_structure(rope, tmp_path / "rope.yam")
    assert not list(tmp_path.iterdir())
