"""Reading a file of plain values: YAML or JSON by its suffix, and one line for whatever is wrong with it."""

from pathlib import Path
from stat import S_ISDIR, S_ISREG

from tensegra.errors import TensegraError, nearest
from tensegra.structure.text import TextError, load_json, load_yaml

__all__ = ["LOADERS", "load_values"]

LOADERS = {".yaml": load_yaml, ".yml": load_yaml, ".json": load_json}
"""What reads a file of each suffix."""


def load_values(path: Path, error_type: type[TensegraError]) -> object:
    """Return the plain values in a file.

    Parameters
    ----------
    path
        A file named `.yaml`, `.yml` or `.json`.
    error_type
        The class of the error to raise.

    Raises
    ------
    TensegraError
        The file cannot be read, or is not what its suffix says.
    """
    load = LOADERS.get(path.suffix.lower())
    if load is None:
        expected = "a file named .yaml, .yml or .json"
        raise error_type.at(path.name, path.suffix, expected, candidates=LOADERS)
    try:
        kind = path.stat().st_mode
        if not S_ISREG(kind) and not S_ISDIR(kind):
            # A pipe or a device may never end, or never begin.
            raise error_type(f"{path}: this is not a file")
        return load(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        match = nearest(path.name, _names_beside(path))
        raise error_type(f"{path}: no such file" + (f"; did you mean {match!r}?" if match else "")) from None
    except UnicodeDecodeError:
        raise error_type(f"{path.name}: this is not a text in UTF-8") from None
    except OSError as error:
        raise error_type(f"{path}: {(error.strerror or str(error)).lower()}") from None
    except TextError as error:
        raise error_type(f"{path.name}: {error}") from None
    except ValueError as error:  # a name that no file can have, such as one with a zero byte
        raise error_type.at("file", str(path), f"the name of a file ({error})") from None


def _names_beside(path: Path) -> list[str]:
    try:
        return [file.name for file in path.parent.iterdir()]
    except OSError:
        return []
