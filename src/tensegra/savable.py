"""What can be saved: the method is here, on the ground floor; the formats that it writes are above."""

import os
from collections.abc import Callable
from typing import Any

from tensegra.above import Above

__all__ = ["Savable", "saver"]

saver: Above[Callable[..., Any]] = Above()
"""What does ``save(what, path, format)``."""


class Savable:
    """What has a method `save`."""

    def save(self, path: str | os.PathLike[str], *, format: str | None = None) -> None:  # noqa: A002 — the word of every library
        """Write this to a file, in the format that its suffix names.

        The formats, what each of them holds and which need an extra are in ``docs/exchange.md``. The
        file appears complete or not at all.

        Parameters
        ----------
        path
            The file.
        format
            The name of a format, where the suffix does not tell: ``compas`` for a .json file.

        Raises
        ------
        ModelError
            No format has this suffix or name, the format cannot hold this, the library that it needs
            is not installed, or the file cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> from pathlib import Path
        >>> import tensegra as tg
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder, "prism.mat")
        ...     tg.library.prism().save(file)
        ...     tg.read_structure(file)
        Structure('prism': 6 nodes, 3 struts, 9 cables, 0 clustered; 12 free dof; units m, N)
        """
        saver()(self, path, format)
