"""How the members of the family's beams run: struts, squares, ties, clustered cables, alike on all sides.

The publication prints 12 struts, 24 nodes, 32 classical and 4 clustered cables. Stages of three struts that
are alike on all their sides have every kind of cable in threes, and neither 32 nor 4 is a multiple of three:
only stages of four struts are left. Three of them have six sections of four nodes; the 32 classical cables
are eight kinds of four, the clustered cables one kind, and each kind is named by one of its members.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

__all__ = ["N_SECTIONS", "N_SIDES", "Layout", "Tie", "all_layouts", "node_id", "reconstruction"]

N_SIDES, N_SECTIONS, N_TIES = 4, 6, 8

Tie = tuple[int, int, int]
"""A kind of cable: from side k of one section to side k + shift of another, as (section, section, shift)."""

_FIRST_STAGE = ((1, 8, 5, 4), (2, 7, 6, 3))
"""Node numbers by section and side; each further stage counts eight on. 18 and 23 are at the free end."""


def node_id(section: int, side: int) -> str:
    """Return the name of a node.

    Examples
    --------
    >>> node_id(0, 0), node_id(5, 0), node_id(5, 1)
    ('1', '18', '23')
    """
    return str(_FIRST_STAGE[section % 2][side % N_SIDES] + 8 * (section // 2))


@dataclass(frozen=True)
class Layout:
    """Which nodes the members join.

    Sides are numbered such that each clustered cable keeps its side through all sections it passes.

    Attributes
    ----------
    shifts
        Of the struts of each stage: a strut runs from side k to side k + shift.
    ties
        The eight kinds of classical cables.
    route
        Sections that the clustered cables pass, in order; the last is the free end.

    Raises
    ------
    ValueError
        If it has not eight different kinds of cables, or a cable lies along a strut.
    """

    shifts: tuple[int, int, int]
    ties: tuple[Tie, ...]
    route: tuple[int, ...] = tuple(range(N_SECTIONS))

    def __post_init__(self) -> None:
        if len(set(self.ties)) != N_TIES:
            raise ValueError(f"{self.ties}: expected {N_TIES} different kinds of cables")
        struts = {(2 * stage, 2 * stage + 1, shift) for stage, shift in enumerate(self.shifts)}
        if struts & set(self.ties):
            raise ValueError(f"{sorted(struts & set(self.ties))}: a cable lies along a strut")

    @property
    def name(self) -> str:
        """Shifts of the struts, then the kinds of cables, and the route where it is not whole."""
        kinds = "_".join(f"{s}{t}{m}" for s, t, m in self.ties)
        whole = self.route == tuple(range(N_SECTIONS))
        return f"{''.join(map(str, self.shifts))}-{kinds}" + (
            "" if whole else f"-{''.join(map(str, self.route))}"
        )

    def segments(self) -> Iterator[tuple[int, int, int, int]]:
        """Give (kind, section, section, shift): kinds 0 to 2 are struts, 3 to 10 cables, 11 is clustered."""
        for stage, shift in enumerate(self.shifts):
            yield stage, 2 * stage, 2 * stage + 1, shift
        for kind, tie in enumerate(self.ties, start=len(self.shifts)):
            yield kind, *tie
        for first, second in zip(self.route, self.route[1:], strict=False):
            yield len(self.shifts) + N_TIES, first, second, 0


SQUARES: tuple[Tie, ...] = tuple((section, section, 1) for section in range(N_SECTIONS))


def reconstruction() -> Layout:
    """Return the layout of the beams that the library has: a square in each section, ties over each overlap.

    Examples
    --------
    >>> reconstruction().name
    '111-001_111_221_331_441_551_020_350'
    """
    return Layout((1, 1, 1), (*SQUARES, (0, 2, 0), (3, 5, 0)))


def mirrored(tie: Tie) -> Tie:
    """Return the kind that a half turn about an axis across the beam makes of a kind.

    Examples
    --------
    >>> mirrored((0, 2, 1))
    (3, 5, 1)
    """
    last = N_SECTIONS - 1
    return (last - tie[1], last - tie[0], tie[2])


def all_layouts() -> list[Layout]:
    """Return the layouts that are searched: alike from both ends, in a fixed order.

    Squares in all sections and one pair of kinds of ties, or squares at the ends and three pairs; all shifts
    of the struts, alike in the outer stages.
    """
    near = [(0, 1), (0, 2), (1, 2), (1, 3), (0, 3)]
    pairs = [
        (s, t, m)
        for s, t in near
        for m in range(N_SIDES)
        if (t != s + 1 or m) and mirrored((s, t, m)) != (s, t, m)
    ]
    layouts = []
    for outer, inner in product((1, 2, 3), (1, 2, 3)):
        shifts = (outer, inner, outer)
        wanted = [(*SQUARES, tie, mirrored(tie)) for tie in pairs]
        wanted += [
            (SQUARES[0], SQUARES[-1], *three, *map(mirrored, three)) for three in combinations(pairs, 3)
        ]
        for ties in wanted:
            try:
                layouts.append(Layout(shifts, ties))
            except ValueError:
                continue
    return layouts
