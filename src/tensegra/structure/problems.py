"""What is wrong with a structure: problems with their places, and the one message they make."""

import reprlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

from tensegra.errors import ModelError

__all__ = ["NOTHING", "InvalidStructureError", "Place", "Problem"]

Place = tuple[str | int, ...]

_shorten = reprlib.Repr()
_shorten.maxstring = _shorten.maxother = 80


class _Shown:
    """Anything, shown in at most a line."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        return self._text


NOTHING = _Shown("nothing")


@dataclass(frozen=True)
class Problem:
    """One fault: where it is, what was found there, what was expected, and known names like it."""

    place: Place
    found: object
    expected: str
    candidates: tuple[str, ...] = ()

    def at(self, source: str, root: Place) -> ModelError:
        """Return the error that tells of this problem in `source`, below the keys `root`."""
        where = _path_text((*root, *self.place))
        found = self.found if isinstance(self.found, str | _Shown) else _Shown(_shorten.repr(self.found))
        return ModelError.at(
            ": ".join(filter(None, (source, where))) or "structure",
            found,
            self.expected,
            candidates=self.candidates,
        )


class InvalidStructureError(ModelError):
    """A structure that cannot be. Its message is the first problem; `problems` holds them all."""

    problems: tuple[Problem, ...] = ()

    @classmethod
    def of(cls, problems: Iterable[Problem], *, source: str = "", root: Place = ()) -> Self:
        """Build the error from at least one problem.

        Parameters
        ----------
        problems
            In the order in which a reader should mend them.
        source
            Name of the file, if there is one.
        root
            Keys above the places of the problems, such as ``("changes",)``.
        """
        problems = tuple(problems)
        message = str(problems[0].at(source, root))
        others = len(problems) - 1
        if others:
            message += f" (and {others} more {'problem' if others == 1 else 'problems'})"
        error = cls(message)
        error.problems = problems
        return error


def _path_text(place: Sequence[str | int]) -> str:
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place)
    return text.removeprefix(".")
