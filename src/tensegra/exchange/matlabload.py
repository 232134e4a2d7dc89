"""SciPy's reader of MATLAB files in a process of its own, which a spoilt cell can end by a fault of memory.

``python -m tensegra.exchange.matlabload FILE NAME…`` writes the matrices of these names, pickled, to stdout.
"""

import pickle
import subprocess
import sys
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

__all__ = ["MatlabFileError", "load"]

REFUSED = 3
"""Exit code with which the process tells that SciPy refused the file, the reason on stderr."""


class MatlabFileError(ValueError):
    """A file that SciPy cannot read; the message says why."""


def load(path: Path, names: Iterable[str]) -> Mapping[str, Any]:
    """Return the variables of these names, and where none is N, the fields of a struct that has one.

    Raises
    ------
    MatlabFileError
        SciPy refuses the file, or its reader breaks off.
    """
    command = [sys.executable, "-m", __name__, str(path), *sorted(names)]
    done = subprocess.run(command, capture_output=True, check=False)  # noqa: S603 — our own interpreter
    if done.returncode == REFUSED:
        raise MatlabFileError(done.stderr.decode(errors="replace").strip().splitlines()[-1])
    if done.returncode:
        raise MatlabFileError("SciPy's reader broke off")
    found: Mapping[str, Any] = pickle.loads(done.stdout)  # noqa: S301 — what our own process has just written
    return found


def _read(path: str, names: list[str]) -> Mapping[str, Any]:
    from scipy.io import loadmat

    with warnings.catch_warnings():
        # Of variables that nobody asked for, such as functions that all have the same name.
        warnings.simplefilter("ignore")
        found = _named(loadmat(path, variable_names=names), names)
        if "N" in found:
            return found
        everything = loadmat(path, simplify_cells=True)
    for value in everything.values():
        if isinstance(value, dict) and "N" in value:
            return _named(value, names)
    return {name: None for name in everything if not name.startswith("__")}


def _named(values: Mapping[str, Any], names: list[str]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if name in names}


def _main() -> None:
    try:
        found = _read(sys.argv[1], sys.argv[2:])
    except Exception as error:  # noqa: BLE001 — SciPy tells a broken file by whatever its reader trips over
        sys.stderr.write(" ".join(str(error).split())[:200] or type(error).__name__)
        raise SystemExit(REFUSED) from None
    sys.stdout.buffer.write(pickle.dumps(found))


if __name__ == "__main__":
    _main()
