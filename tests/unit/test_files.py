"""A file is what it was until it is what it shall be, whatever happens in between."""

import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra.errors import ModelError, StudyError, TensegraError
from tensegra.files import drafting, is_draft, replacing, require_file_names, telling, write_json, write_text
from tensegra.report.results import write_json as write_result
from tensegra.report.tables import write_history
from tensegra.structure import library, write_structure
from tensegra.study import write_points
from tensegra.surrogate.archive import write_archive


@pytest.fixture
def old(tmp_path):
    path = tmp_path / "file.json"
    path.write_text("old", encoding="utf-8")
    return path


def test_the_old_file_is_there_until_the_new_one_is_whole(old):
    with replacing(old) as file:
        file.write(b"new")
        assert old.read_text(encoding="utf-8") == "old"
        (draft,) = set(old.parent.iterdir()) - {old}
        assert is_draft(draft)
        assert draft.suffix == old.suffix
    assert old.read_bytes() == b"new"
    assert list(old.parent.iterdir()) == [old]


@pytest.mark.parametrize("fault", [ValueError, KeyboardInterrupt, MemoryError])
def test_what_fails_in_between_leaves_the_old_file_and_no_draft(old, fault):
    def half_of_it():
        yield b"half"
        raise fault

    with pytest.raises(fault), replacing(old, StudyError) as file:
        file.writelines(half_of_it())
    assert old.read_text(encoding="utf-8") == "old"
    assert list(old.parent.iterdir()) == [old]


def test_the_content_is_on_the_disk_before_it_takes_the_name(old, monkeypatch):
    done = []
    monkeypatch.setattr("tensegra.files.os.fsync", lambda _descriptor: done.append("synced"))
    replace = type(old).replace

    def replaced(self, target):
        done.append("replaced")
        return replace(self, target)

    monkeypatch.setattr(type(old), "replace", replaced)
    write_text(old, "new")
    assert done[:2] == ["synced", "replaced"]


def test_a_full_disk_is_told_with_the_advice(old, monkeypatch):
    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tensegra.files.os.fsync", full)
    expected = r"file\.json: cannot be written \(no space left on device\); go home$"
    with pytest.raises(StudyError, match=expected), replacing(old, StudyError, "; go home") as file:
        file.write(b"new")
    assert old.read_text(encoding="utf-8") == "old"
    assert list(old.parent.iterdir()) == [old]


def test_a_library_that_opens_by_name_gets_a_name(old):
    with drafting(old) as draft:
        draft.write_text("new", encoding="utf-8")
    assert old.read_text(encoding="utf-8") == "new"


@pytest.mark.parametrize("place", ["missing/file.json", "file.json/below.json", "."])
def test_a_place_that_cannot_hold_a_file_is_refused(old, place):
    with pytest.raises(ModelError, match="cannot be written"):
        write_text(old.parent / place, "new", ModelError)
    assert list(old.parent.iterdir()) == [old]


def test_json_that_would_hold_no_number_is_not_written(old):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(old, {"a": float("nan")})
    assert old.read_text(encoding="utf-8") == "old"


def test_a_name_as_long_as_a_system_takes_can_be_written(tmp_path):
    path = tmp_path / ("ü" * 125 + ".csv")  # 254 bytes of 255
    write_text(path, "x")
    assert path.read_text(encoding="utf-8") == "x"


def test_what_is_there_keeps_its_reason(tmp_path):
    with pytest.raises(TensegraError, match="file exists") as caught, telling(tmp_path):
        tmp_path.mkdir()
    assert isinstance(caught.value.__cause__, FileExistsError)


@pytest.mark.parametrize("name", ["study.yaml", ".hidden.csv", "a.writing.csv", "0-x.parquet"])
def test_what_is_no_draft_is_none(tmp_path, name):
    assert not is_draft(tmp_path / name)


def test_every_writer_leaves_the_old_file_where_the_disk_is_full(tmp_path, monkeypatch, drawn_path):
    def full(_descriptor):
        raise OSError(28, "No space left on device")

    writers = {
        "s.yaml": lambda path: write_structure(library.prism(3), path),
        "h.csv": lambda path: write_history(drawn_path, path),
        "h.parquet": lambda path: write_history(drawn_path, path),
        "p.csv": lambda path: write_points(path, ["a"], np.ones((2, 1))),
        "p.parquet": lambda path: write_points(path, ["a"], np.ones((2, 1))),
        "r.json": lambda path: write_result(path, {"a": 1}),
        "w.tg": lambda path: write_archive(path, b"{}", {"a": np.ones(3)}),
    }
    for name, write in writers.items():
        (tmp_path / name).write_text("old", encoding="utf-8")
        with monkeypatch.context() as patch:
            patch.setattr("tensegra.files.os.fsync", full)
            with pytest.raises(TensegraError, match=f"{name}: cannot be written .no space"):
                write(tmp_path / name)
        assert (tmp_path / name).read_text(encoding="utf-8") == "old"
        write(tmp_path / name)
        assert (tmp_path / name).read_bytes() != b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(writers)


@pytest.fixture(scope="module")
def drawn_path():
    from tensegra.mechanics import solve_path

    return solve_path(library.prism(3))


@given(st.text(min_size=1, max_size=20))
def test_a_name_that_is_taken_leads_to_no_other_folder(name):
    try:
        require_file_names([name], "names", StudyError)
    except StudyError:
        return
    assert os.path.basename(name) == name  # noqa: PTH119 - of the text, not of a path
    assert name not in {".", ".."}
