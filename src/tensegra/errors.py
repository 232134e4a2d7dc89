"""Errors that tensegra raises, and the wording that they share.

A bad input is answered with one message that says where it is, what was found, what was expected
and which known name comes nearest. A numerical failure is a status, never an exception, unless the
caller asks for one (`raise_for_status`).
"""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Self


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
        message = f"{place}: found {found!r}, expected {expected}"
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


def nearest(name: object, candidates: Iterable[object]) -> str | None:
    """Return the candidate that `name` was most likely meant to be, or None.

    Examples
    --------
    >>> nearest("alumnium", ["aluminium", "steel"])
    'aluminium'
    >>> nearest("wood", ["aluminium", "steel"]) is None
    True
    """
    known = {str(candidate): None for candidate in candidates}
    folded = {candidate.lower(): candidate for candidate in known}
    matches = get_close_matches(str(name).lower(), folded, n=1, cutoff=0.6)
    return folded[matches[0]] if matches else None
