"""Two names for one quantity: what is one too many, in a stage, in a run and in a study alike.

A group and its member, or two groups that share a member, can name the same thing. Differences add
up: the temperatures, loads and shifts of a run come on top of those of the stages and of each
other, and actuators that share a member multiply. A value (an area, a modulus, a rest length, a
temperature in a stage) is given once: what two values would mean, the last or the nearer name, is
anyone's guess, so they are refused, equal or not.
"""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from tensegra.errors import ModelError

if TYPE_CHECKING:
    from tensegra.structure.structure import Structure

__all__ = ["Overlap", "find_overlaps", "member_parts", "require_one_change"]


class Overlap(NamedTuple):
    """A name that changes what an earlier one changes already.

    Attributes
    ----------
    name, earlier
        The two names, as they were given.
    part
        What both of them name, such as ``"member 'K1'"``.
    """

    name: str
    earlier: str
    part: str

    def expected(self, quantity: str) -> str:
        """Return what an error says was expected: one change of the quantity, not two."""
        return f"one {quantity} of {self.part}, which {self.earlier!r} sets too"


def find_overlaps(parts_of: Iterable[tuple[str, Iterable[str]]]) -> Iterator[Overlap]:
    """Yield each name of which a part was named before, with the first such part.

    Parameters
    ----------
    parts_of
        Names in their order, each with all that it changes.

    Examples
    --------
    >>> list(find_overlaps([("top", ["member 'K1'", "member 'K2'"]), ("K2", ["member 'K2'"])]))
    [Overlap(name='K2', earlier='top', part="member 'K2'")]
    """
    given: dict[str, str] = {}
    for name, parts in parts_of:
        first: Overlap | None = None
        for part in parts:
            if part in given:
                first = first or Overlap(name, given[part], part)
            else:
                given[part] = name
        if first is not None:
            yield first


def require_one_change(structure: "Structure", quantity: str, names: Iterable[str | int]) -> None:
    """Refuse names of members and groups of which two give the same member a value.

    Parameters
    ----------
    structure
        Whose members they are.
    quantity
        What is changed, such as ``"area"``.
    names
        Members and groups, in the order in which they were given.

    Raises
    ------
    ModelError
        Naming both; or for a name that the structure does not have.
    """
    for overlap in find_overlaps((str(name), member_parts(structure, name)) for name in names):
        raise ModelError.at(quantity, overlap.name, overlap.expected(quantity))


def member_parts(structure: "Structure", name: str | int) -> list[str]:
    """Return what a member or a group changes, as `find_overlaps` takes it."""
    return [f"member {member!r}" for member in structure.members_named(name)]
