"""Bars of outcomes: as printed, by the publication's procedure, along stable paths."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from tensegra.report.figures import figure, styled

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

__all__ = ["outcome_figure"]

COLOURS = {
    "upward": "#0072B2",
    "irregular (as printed)": "#E69F00",
    "stable, tip not above its start": "#56B4E9",
    "stable, off the path": "#009E73",
    "does not stand": "#CC79A7",
    "prestress lost": "#D55E00",
    "spurious root, beyond the law": "#8c8c8c",
    "not converged": "#000000",
}
"""Okabe and Ito's palette, one colour an outcome."""

LEAST_NAMED = 3.0
"""Percent below which a piece of a bar is too short for its number."""


@styled
def outcome_figure(
    printed: Mapping[str, Mapping[str, float]], ours: Mapping[str, Mapping[str, Mapping[str, float]]]
) -> "Figure":
    """Draw the shares of outcomes as stacked bars.

    Parameters
    ----------
    printed
        By group and outcome, in percent.
    ours
        By group, procedure and outcome, in percent.
    """
    made = figure(3.3)
    for column, group in enumerate(printed):
        axes = made.add_subplot(1, len(printed), column + 1)
        bars = {"printed": printed[group]} | {
            {"stepped": "stepped", "path": "along stable\npaths"}[name]: shares
            for name, shares in ours[group].items()
        }
        for place, shares in enumerate(bars.values()):
            left = 0.0
            for outcome, colour in COLOURS.items():
                share = shares.get(outcome, 0.0)
                if share <= 0.0:
                    continue
                axes.barh(place, share, left=left, color=colour, height=0.62, label=outcome, linewidth=0)
                if share >= LEAST_NAMED:
                    dark = colour in ("#000000", "#0072B2", "#D55E00", "#009E73")
                    axes.text(
                        left + 0.5 * share,
                        place,
                        f"{share:.1f}",
                        ha="center",
                        va="center",
                        fontsize=7.5,
                        color="white" if dark else "black",
                    )
                left += share
        axes.set_yticks(range(len(bars)), list(bars) if column == 0 else [""] * len(bars))
        axes.invert_yaxis()
        axes.set_xlim(0.0, 100.0)
        axes.set_xlabel("share of runs [%]")
        axes.set_title(f"({'ab'[column]}) {group}")
        axes.grid(visible=False, axis="y")
    _legend(made)
    return made


def _legend(made: "Figure") -> None:
    named: dict[str, Artist] = {}
    for axes in made.axes:
        handles, labels = axes.get_legend_handles_labels()
        named |= dict(zip(labels, handles, strict=True))
    order = [outcome for outcome in COLOURS if outcome in named]
    handles = [named[outcome] for outcome in order]
    made.legend(handles, order, loc="outside upper center", ncols=4, fontsize=7.5)
