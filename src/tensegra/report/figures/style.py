"""How all figures look: colours that colour-blind readers tell apart, sizes, and the way to SVG.

Figures are made with matplotlib's objects alone; there is no pyplot, no window and no global state.
"""

from functools import lru_cache, wraps
from io import BytesIO
from typing import TYPE_CHECKING, Any, ParamSpec

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "BLACK",
    "BLUE",
    "COLOURS",
    "GREEN",
    "GREY",
    "ORANGE",
    "PURPLE",
    "SKY",
    "STATUS_COLOURS",
    "VERMILION",
    "WIDTH",
    "YELLOW",
    "figure",
    "grid",
    "legend_above",
    "pdf",
    "styled",
    "svg",
]

P = ParamSpec("P")

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#F0E442",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK)
"""Okabe and Ito's palette (2008) without its yellow, which is too light for lines on white."""

GREY = "#8c8c8c"

STATUS_COLOURS = {
    "stable": BLUE,
    "snapped": GREEN,
    "unstable": PURPLE,
    "collapsed": VERMILION,
    "failed": BLACK,
}

WIDTH = 7.4
"""Inches; the report's column."""

LEGEND_HANDLE, LEGEND_LETTER = 0.45, 0.062
"""Inches that an entry of a legend takes beside its text, and one letter of it."""

_STYLE: dict[str, Any] = {
    "figure.constrained_layout.use": True,
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.labelsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 5),
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.5,
    "savefig.dpi": 160,
    "svg.hashsalt": "tensegra",
}


def styled(make: "Callable[P, Figure]") -> "Callable[P, Figure]":
    """Let a function make its figure in the report's style, whatever the user's own is."""

    @wraps(make)
    def in_style(*args: P.args, **kwargs: P.kwargs) -> "Figure":
        from matplotlib import rc_context, rcParamsDefault

        own: dict[Any, Any] = {key: value for key, value in rcParamsDefault.items() if key not in _NOT_STYLE}
        with rc_context(own | _STYLE):
            made = make(*args, **kwargs)
            _name_powers(made)
            return made

    return in_style


# Not in matplotlib's formulas: with them each tick of an axis is parsed, half the time of a report.
_SUPERSCRIPTS = str.maketrans("-−0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _name_powers(made: "Figure") -> None:
    """Put the power of ten of an axis into its name; matplotlib writes it over what stands beside."""
    for axes in made.axes:
        for axis in (axes.xaxis, axes.yaxis):
            formatter, name = axis.get_major_formatter(), axis.get_label().get_text()
            formatter.set_locs([float(place) for place in axis.get_majorticklocs()])
            power = formatter.get_offset().removeprefix("1e")
            if power and name:
                axis.set_label_text(f"{name}  ×10{power.translate(_SUPERSCRIPTS)}")
                axis.get_offset_text().set_visible(False)


_NOT_STYLE = ("backend", "backend_fallback", "interactive", "toolbar", "timezone")
"""What matplotlib counts among its defaults, and rightly warns of setting."""


def figure(height: float, width: float = WIDTH) -> "Figure":
    """Return an empty figure of a size in inches, which a notebook shows as it is."""
    return _shown_by_notebooks()(figsize=(width, height), layout="constrained")


@lru_cache(maxsize=1)
def _shown_by_notebooks() -> "type[Figure]":
    """Return the class of all figures; matplotlib's own is shown where pyplot is loaded only."""
    from matplotlib.figure import Figure

    class Drawing(Figure):
        def _repr_png_(self) -> bytes:
            return _saved(self, "png", {})

    return Drawing


def grid(n_panels: int, columns: int = 3, height: float = 2.3) -> "tuple[Figure, list[Axes]]":
    """Return a figure of equal panels in rows of at most `columns`."""
    columns = min(columns, n_panels)
    rows = -(-n_panels // columns)
    made = figure(height * rows, WIDTH if columns > 1 else 0.6 * WIDTH)
    axes = [made.add_subplot(rows, columns, i + 1) for i in range(n_panels)]
    return made, axes


def legend_above(made: "Figure", axes: "Axes", scale: float = 1.0) -> None:
    """Put the legend of one panel above all of them, its dots `scale` times larger."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        room = made.bbox.width / made.dpi
        fitting = (n for n in range(min(len(labels), 5), 1, -1) if _legend_width(labels, n) <= room)
        columns = next(fitting, 1)
        made.legend(handles, labels, loc="outside upper center", ncols=columns, markerscale=scale)


def _legend_width(labels: "Sequence[str]", columns: int) -> float:
    """Estimate the width of a legend in inches; its entries fill one column after the other."""
    rows, longer = divmod(len(labels), columns)
    ends = [(i + 1) * rows + min(i + 1, longer) for i in range(columns)]
    parts = [labels[begin:end] for begin, end in zip([0, *ends], ends, strict=False)]
    return sum(LEGEND_HANDLE + LEGEND_LETTER * max(map(len, part)) for part in parts)


def svg(made: "Figure") -> bytes:
    """Return a figure as SVG; the same figure gives the same bytes."""
    return _saved(made, "svg", {"Date": None, "Creator": None})


def pdf(made: "Figure") -> bytes:
    """Return a figure as PDF; the same figure gives the same bytes."""
    return _saved(made, "pdf", {"CreationDate": None, "Creator": None, "Producer": None})


def _saved(made: "Figure", form: str, metadata: dict[str, Any]) -> bytes:
    from matplotlib import rc_context

    buffer = BytesIO()
    with rc_context({"svg.hashsalt": _STYLE["svg.hashsalt"], "savefig.dpi": _STYLE["savefig.dpi"]}):
        made.savefig(buffer, format=form, metadata=metadata)
    return buffer.getvalue()
