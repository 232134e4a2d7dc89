"""What is written by a format and read again is what it was, to the last digits."""

from pathlib import Path

import numpy as np
import pytest
from comparing import assert_same
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import tensegra as tg
from tensegra.exchange.formats import FORMATS
from tensegra.structure import Member, Structure, library
from tensegra.structure.structure import path_length

LIBRARIES = {"dxf": "ezdxf", "mujoco": "mujoco"}
TWO_WAYS = [form for form in FORMATS if form.read is not None]
WITH_GROUPS = {"csv", "compas"}
"""Formats that hold all groups of a member; the others have none, or the first alone."""

WITH_UNITS = {"compas", "dxf"}
"""Formats that tell the unit of length; the first that of force, too."""


def needed(form):
    if form.name in LIBRARIES:
        pytest.importorskip(LIBRARIES[form.name])


def said(form, structure):
    units = structure.units
    length = {} if form.name in WITH_UNITS else {"unit": units.length}
    return length | ({} if form.name == "compas" else {"force_unit": units.force})


@pytest.mark.parametrize("form", TWO_WAYS, ids=lambda form: form.name)
@pytest.mark.parametrize("name", library.__all__)
def test_every_structure_of_the_library_comes_back(form, name, tmp_path):
    needed(form)
    structure = getattr(library, name)()
    file = tmp_path / f"a{form.suffix}"
    structure.save(file, format=form.name)
    found = tg.read_structure(file, format=form.name, **said(form, structure))
    assert_same(found, structure, groups=form.name in WITH_GROUPS)
    assert found.units.length == structure.units.length
    assert found.units.force == structure.units.force


@pytest.mark.parametrize("form", TWO_WAYS, ids=lambda form: form.name)
def test_a_path_comes_back_as_it_ended(form, beam_path, tmp_path):
    needed(form)
    file = tmp_path / f"a{form.suffix}"
    beam_path.save(file, format=form.name)
    found = tg.read_structure(file, format=form.name, **said(form, beam_path.structure))
    load = beam_path.load
    assert_same(
        found, beam_path.structure, nodes=beam_path.final.nodes, rest_length=load.rest_length, groups=False
    )


@pytest.mark.parametrize("form", TWO_WAYS, ids=lambda form: form.name)
def test_what_comes_back_stands_where_it_stood(form, tmp_path):
    needed(form)
    path = tg.solve_path(library.prism(3, clustered=True), {"top": 0.05})
    file = tmp_path / f"a{form.suffix}"
    path.save(file, format=form.name)
    again = tg.solve_path(tg.read_structure(file, format=form.name))
    assert again.status == "stable"
    order = [again.structure.node_ids.index(node) for node in path.structure.node_ids]
    assert np.abs(again.final.nodes[order] - path.final.nodes).max() < 1e-9


# Letters, spaces, quotes and signs that mean something to one format or another.
ids = st.text(st.sampled_from("ab1 '\",;:.<>&[]()=#%$\\/-_éß→💥"), min_size=1, max_size=8).filter(
    lambda text: text == text.strip()
)
numbers = st.floats(-1e6, 1e6, allow_subnormal=False).filter(lambda x: x == 0.0 or abs(x) > 1e-6)


@st.composite
def structures(draw):
    nodes = draw(st.lists(ids, min_size=4, max_size=4, unique=True))
    members = draw(st.lists(ids, min_size=3, max_size=3, unique=True))
    places = draw(
        st.lists(st.tuples(numbers, numbers, numbers), min_size=4, max_size=4).filter(
            lambda p: min(np.linalg.norm(np.subtract(p[i], p[j])) for i in range(4) for j in range(i)) > 1.0
        )
    )
    stiffness = draw(st.floats(1e-3, 1e9))
    paths = [(nodes[0], nodes[1]), (nodes[0], nodes[2], nodes[1]), (nodes[2], nodes[3])]
    kinds = ["strut", "cable", draw(st.sampled_from(["strut", "cable"]))]
    at = dict(zip(nodes, places, strict=True))
    stretch = st.floats(0.5, 2.0)
    return Structure(
        name="drawn",
        nodes=at,
        members={
            name: Member(kind, path, rest_length=path_length(at, path) * draw(stretch), stiffness=stiffness)
            for name, kind, path in zip(members, kinds, paths, strict=True)
        },
        supports={nodes[0]: "xyz", nodes[3]: "z"},
    )


@pytest.mark.parametrize("form", TWO_WAYS, ids=lambda form: form.name)
@settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, *HealthCheck]
)
@given(structure=structures())
def test_any_names_and_numbers_come_back(form, structure, tmp_path):
    needed(form)
    file = Path(tmp_path) / f"a{form.suffix}"
    structure.save(file, format=form.name)
    assert_same(tg.read_structure(file, format=form.name), structure, groups=False)
    assert {path.name for path in tmp_path.iterdir()} <= {file.name, "a_nodes.csv", "a_members.csv"}
