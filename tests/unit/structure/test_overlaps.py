import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra.errors import ModelError
from tensegra.structure import library
from tensegra.structure.overlaps import Overlap, find_overlaps, member_parts, require_one_change


@pytest.fixture(scope="module")
def beam():
    return library.paper_beam()


def test_each_later_name_is_told_once_with_the_first_that_it_meets():
    named = [("a", "xy"), ("b", "z"), ("c", "zyx"), ("d", "x")]
    assert list(find_overlaps(named)) == [Overlap("c", "b", "z"), Overlap("d", "a", "x")]


def test_one_name_can_be_too_many_by_itself():
    assert list(find_overlaps([("a", "xyx")])) == [Overlap("a", "a", "x")]


@given(st.lists(st.tuples(st.text(max_size=2), st.lists(st.integers(0, 9), max_size=3)), max_size=5))
def test_there_is_none_exactly_where_no_part_is_named_twice(entries):
    named = [(name, [str(part) for part in parts]) for name, parts in entries]
    every = [part for _, parts in named for part in parts]
    assert (not list(find_overlaps(named))) == (len(every) == len(set(every)))


def test_a_group_and_its_member_are_refused_in_either_order(beam):
    member = beam.groups["top"][0]
    for names in (["top", member], [member, "top"]):
        with pytest.raises(ModelError, match=f"found '{names[1]}'.*which '{names[0]}' sets too"):
            require_one_change(beam, "area", names)


def test_groups_that_share_nothing_are_not_refused(beam):
    parts = {name: member_parts(beam, name) for name in ("top", "bottom")}
    assert all(parts.values())
    assert not set(parts["top"]) & set(parts["bottom"])
    require_one_change(beam, "temperature", list(parts))
    with pytest.raises(ModelError, match="'top' sets too"):
        require_one_change(beam, "temperature", [*parts, beam.groups["top"][0]])


def test_an_integer_and_its_text_are_one_name(beam):
    renamed = beam.replace(
        members={str(i): m for i, m in enumerate(beam.members.values())}, actuators={}, stages=()
    )
    with pytest.raises(ModelError, match="member '5', which '5' sets too"):
        require_one_change(renamed, "area", [5, "5"])


def test_an_unknown_name_is_refused_with_the_nearest(beam):
    with pytest.raises(ModelError, match="did you mean 'top'"):
        member_parts(beam, "topp")
