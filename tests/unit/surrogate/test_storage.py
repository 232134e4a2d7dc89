import json
import zipfile

import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.surrogate import fit, load


@pytest.fixture
def saved(tmp_path):
    X = np.random.default_rng(0).uniform(size=(30, 2))
    return fit((X, X.sum(axis=1)), "pce").save(tmp_path / "sum.tg")


def rewritten(path, changes, *, without=()):
    """Write the same file with some entries replaced or left out."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist() if name not in without}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (entries | changes).items():
            archive.writestr(name, content)
    return path


def header(path):
    with zipfile.ZipFile(path) as archive:
        return json.loads(archive.read("surrogate.json"))


def test_header_is_readable(saved):
    text = header(saved)
    assert text["format"] == "tensegra/surrogate/2"
    assert text["kind"] == "pce"
    assert text["validation"]["method"] == "held out 6"


def test_another_version_is_refused(saved):
    newer = json.dumps(header(saved) | {"format": "tensegra/surrogate/3"})
    with pytest.raises(
        StudyError, match=r"format: found 'tensegra/surrogate/3', expected 'tensegra/surrogate/2'"
    ):
        load(rewritten(saved, {"surrogate.json": newer}))


def test_an_unknown_kind_is_refused(saved):
    with pytest.raises(StudyError, match="kind of surrogate: found 'oracle'"):
        load(rewritten(saved, {"surrogate.json": json.dumps(header(saved) | {"kind": "oracle"})}))


@pytest.mark.parametrize("content", [b"", b"once upon a time", b"PK\x03\x04 broken"])
def test_a_foreign_file_is_refused(tmp_path, content):
    path = tmp_path / "foreign.tg"
    path.write_bytes(content)
    with pytest.raises(StudyError, match=r"foreign\.tg: not a surrogate"):
        load(path)


def test_a_foreign_zip_is_refused(tmp_path):
    np.savez(tmp_path / "arrays.npz", x=np.zeros(3))
    with pytest.raises(StudyError, match=r"without surrogate\.json"):
        load(tmp_path / "arrays.npz")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(StudyError, match="no such file"):
        load(tmp_path / "nowhere.tg")


def test_a_damaged_file_is_refused(saved):
    with pytest.raises(StudyError, match=r"damaged surrogate .*input_shift"):
        load(rewritten(saved, {}, without=["arrays/scaling.input_shift.npy"]))
    with pytest.raises(StudyError, match="damaged"):
        load(rewritten(saved, {"surrogate.json": "{"}))


def test_an_array_of_objects_is_refused(saved, tmp_path):
    np.save(tmp_path / "objects.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(StudyError, match="Object arrays cannot be loaded"):
        load(rewritten(saved, {"arrays/bounds.npy": (tmp_path / "objects.npy").read_bytes()}))


def test_a_failed_save_leaves_nothing_behind(saved, tmp_path):
    surrogate = load(saved)
    surrogate.options["odd"] = object()
    before = saved.read_bytes()
    with pytest.raises(TypeError, match="cannot be saved"):
        surrogate.save(saved)
    assert saved.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["sum.tg"]


def test_numpy_options_are_saved_as_plain_numbers(tmp_path):
    X = np.random.default_rng(0).uniform(size=(30, 2))
    surrogate = fit((X, X), "pce", degree=np.int64(2))
    assert load(surrogate.save(tmp_path / "a.tg")).options == {"degree": 2}
