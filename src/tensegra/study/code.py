"""Which code this is: a digest of the package, the same wherever the same files lie."""

from functools import cache
from hashlib import sha256
from pathlib import Path

__all__ = ["digest_of_code"]


@cache
def digest_of_code() -> str:
    """Return the SHA-256, in hexadecimal, of all modules of the package: their names and their texts.

    A version number is the same from one release to the next, whatever is edited in between.

    Examples
    --------
    >>> len(digest_of_code())
    64
    """
    root = Path(__file__).parents[1]
    digest = sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()
