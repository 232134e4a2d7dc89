"""Names that become files: one rule for all of them, asked where the name is read."""

from collections.abc import Iterable

from tensegra.errors import TensegraError

__all__ = ["LONGEST", "require_file_names"]

LONGEST = 100
"""Bytes of a name: with a suffix and what marks a file as being written it stays below the 255 of most
file systems, and below the 143 of an encrypted one."""

_FORBIDDEN = frozenset('/\\:*?"<>|')

_RESERVED = frozenset(
    {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(1, 10))}
)
"""Names that Windows keeps for devices, whatever their suffix."""


def require_file_names(names: Iterable[str], place: str, error_type: type[TensegraError]) -> None:
    """Refuse names that cannot be those of files beside one another, on any system.

    Parameters
    ----------
    names
        The names, without suffixes.
    place
        Where they stand, the beginning of every message.
    error_type
        The class of the error to raise.

    Raises
    ------
    TensegraError
        A name would lead to another folder, cannot be a file's, or is another's but for its case.

    Examples
    --------
    >>> from tensegra.errors import StudyError
    >>> require_file_names(["pce", "Kriging 2"], "surrogates", StudyError)
    >>> require_file_names(["../pce"], "surrogates", StudyError)
    Traceback (most recent call last):
    tensegra.errors.StudyError: surrogates: found '../pce', expected a name that a file can have: ...
    """
    seen: dict[str, str] = {}
    for name in names:
        fault = _fault(name)
        if fault:
            raise error_type.at(place, name, f"a name that a file can have: {fault}")
        other = seen.setdefault(name.casefold(), name)
        if other != name:
            expected = f"another name: its file would be that of {other!r} where case makes no difference"
            raise error_type.at(place, name, expected)


def _fault(name: str) -> str:
    """Return what a name may not have, as a phrase; nothing if it is sound."""
    if not name.isprintable() or _FORBIDDEN & set(name):
        return f"printable characters but {' '.join(sorted(_FORBIDDEN))}"
    if not name or name.startswith((".", " ", "-")) or name.endswith((".", " ")):
        return "no point, space or hyphen at its beginning, no point or space at its end"
    if name.partition(".")[0].casefold() in _RESERVED:
        return "none that Windows keeps for a device"
    if len(name.encode(errors="replace")) > LONGEST:
        return f"at most {LONGEST} bytes"
    return ""
