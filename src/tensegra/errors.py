"""Errors that tensegra raises, and the wording that they share.

A bad input is answered with one message that says where it is, what was found, what was expected
and which known name comes nearest. A numerical failure is a status, never an exception, unless the
caller asks for one (`raise_for_status`).
"""

import reprlib
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Self

LONGEST_FOUND, LONGEST_PLACE, LONGEST_PHRASE = 200, 400, 1200
"""Characters of a message that a value found, its place and what was expected may take: a value of a
hundred thousand is told by its beginning and its end, a list of a thousand names by its beginning."""

LONGEST_NAME = 100
"""Characters of a name that is compared with known ones; longer ones are no misspelling of any."""

_repr = reprlib.Repr()
_repr.maxstring = _repr.maxother = _repr.maxlong = LONGEST_FOUND
_repr.maxlist = _repr.maxtuple = _repr.maxdict = _repr.maxset = _repr.maxfrozenset = _repr.maxarray = 24


class TensegraError(Exception):
    """Base of every error that tensegra raises on purpose."""

    @classmethod
    def at(
        cls,
        place: str,
        found: object,
        expected: str,
        *,
        candidates: Iterable[object] = (),
    ) -> Self:
        """Build the error from its four parts.

        Parameters
        ----------
        place
            Where the fault is: a file and a path of keys such as ``members.K1.nodes[2]``.
        found
            The offending value, shown as it was written.
        expected
            What would have been right, as a phrase.
        candidates
            Known names; the one nearest to `found` is offered as a correction.

        Examples
        --------
        >>> print(ModelError.at("members.K1.kind", "cabel", "a kind", candidates=["cable", "strut"]))
        members.K1.kind: found 'cabel', expected a kind; did you mean 'cable'?
        """
        where, wanted = shortened(place, LONGEST_PLACE), shortened(expected, LONGEST_PHRASE)
        message = f"{where}: found {shown(found)}, expected {wanted}"
        match = nearest(found, candidates)
        if match is not None:
            message += f"; did you mean {match!r}?"
        return cls(message)


class ModelError(TensegraError):
    """A structure, or a change to one, that cannot be: unknown names, impossible values."""


class SolverError(TensegraError):
    """A numerical failure that the caller asked to be raised instead of reported as a status."""


class StudyError(TensegraError):
    """A study, a campaign or an analysis that cannot be carried out as it is written."""


def shown(value: object) -> str:
    """Return a value as it is written in Python, in at most a line or two.

    Examples
    --------
    >>> shown("beam"), shown([1, "a"]), len(shown("a" * 100_000))
    ("'beam'", "[1, 'a']", 200)
    """
    try:
        return shortened(_repr.repr(value), LONGEST_FOUND)
    except (ValueError, RecursionError):  # a whole number of too many digits; lists within lists
        return f"<{type(value).__name__}>"


def shortened(text: str, most: int) -> str:
    """Return a text of at most `most` characters, its middle left out where it is longer.

    Examples
    --------
    >>> shortened("abcdefghij", 7)
    'ab...ij'
    """
    if len(text) <= most:
        return text
    kept = (most - 3) // 2
    return f"{text[: most - 3 - kept]}...{text[-kept:]}"


def nearest(name: object, candidates: Iterable[object]) -> str | None:
    """Return the candidate that `name` was most likely meant to be, or None.

    Examples
    --------
    >>> nearest("alumnium", ["aluminium", "steel"])
    'aluminium'
    >>> nearest("wood", ["aluminium", "steel"]) is None
    True
    """
    if len(str(name)) > LONGEST_NAME:
        return None
    known = {str(candidate): None for candidate in candidates}
    folded = {candidate.lower(): candidate for candidate in known}
    matches = get_close_matches(str(name).lower(), folded, n=1, cutoff=0.6)
    return folded[matches[0]] if matches else None
