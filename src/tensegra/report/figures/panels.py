"""Which variables and outputs a figure has panels for: a bounded number, chosen and told.

A figure with a panel for each of a hundred variables shows nothing and takes minutes; the tables beside it
have them all.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tensegra.study import Study
from tensegra.study.space import Space

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["MOST_PANELS", "Panels", "choose_panels", "constant_note", "first_shown", "strongest", "varying"]

MOST_PANELS = 6
"""Variables, and outputs, that one figure shows: as many as are still read at the width of a page."""

MOST_RANKED = 2000
"""Runs that tell which variables matter; as many more change nothing that is seen."""

ROUNDING = 1e-12
"""Of an output's magnitude: what scatters less does not vary; a surrogate of a constant rounds."""

Value = TypeVar("Value")


@dataclass(frozen=True)
class Panels:
    """The variables and outputs that the figures of a campaign show.

    Attributes
    ----------
    variables, outputs
        Their names, in the order of the study.
    n_variables, n_outputs
        How many the study has.
    constant
        Outputs that do not vary, of which no figure is drawn.
    """

    variables: tuple[str, ...]
    outputs: tuple[str, ...]
    n_variables: int
    n_outputs: int
    constant: tuple[str, ...] = ()

    @property
    def notes(self) -> list[str]:
        """What is not drawn, and why; nothing where all is."""
        notes = []
        if len(self.variables) < self.n_variables:
            notes.append(
                f"Of {self.n_variables} variables the figures show the {len(self.variables)} on which the "
                f"outputs depend most, by rank correlation: {', '.join(self.variables)}."
            )
        varying = self.n_outputs - len(self.constant)
        if len(self.outputs) < varying:
            notes.append(
                f"Of {varying} outputs the figures show {len(self.outputs)}, those that an analysis names "
                f"first: {', '.join(self.outputs)}."
            )
        if self.constant:
            notes.append(constant_note(self.constant))
        return notes

    def of(self, study: Study) -> Study:
        """Return the study as if it had these variables and outputs only, for a figure of it."""
        variables = tuple(v for v in study.variables if v.name in self.variables)
        outputs = tuple(output for output in study.outputs if output.name in self.outputs)
        return replace(study, space=Space(variables), outputs=outputs or study.outputs[:1])


def choose_panels(study: Study, frame: "pd.DataFrame") -> Panels:
    """Choose what the figures of a campaign show.

    Outputs that analyses name come first, then the others in the order of the study; variables by the
    largest rank correlation with one of those outputs.
    """
    Y = frame[list(study.output_names)].to_numpy(dtype=float)
    varies = dict(zip(study.output_names, _spread(Y) > 0.0, strict=True))
    named = _named_outputs(study)
    wanted = sorted(filter(varies.__getitem__, study.output_names), key=lambda name: name not in named)
    outputs = [name for name in study.output_names if name in wanted[:MOST_PANELS]]
    strength = _rank_correlation(frame, study.input_names, outputs)
    chosen = strongest(strength, MOST_PANELS)
    return Panels(
        variables=tuple(study.input_names[i] for i in chosen),
        outputs=tuple(outputs),
        n_variables=len(study.input_names),
        n_outputs=len(study.output_names),
        constant=tuple(name for name, does in varies.items() if not does),
    )


def strongest(strength: np.ndarray, most: int) -> list[int]:
    """Return the numbers of the greatest values, in the order in which they stand.

    Examples
    --------
    >>> strongest(np.array([0.1, 0.9, np.nan, 0.5]), 2)
    [1, 3]
    """
    order = np.argsort(-np.nan_to_num(np.abs(strength)), kind="stable")[:most]
    return sorted(int(i) for i in order)


def first_shown(items: Mapping[str, Value], most: int = MOST_PANELS) -> dict[str, Value]:
    """Return the first items of a mapping, as many as a figure has panels for."""
    return dict(list(items.items())[:most])


def varying(content: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Return what an analysis found of outputs that vary, and the names of those that do not.

    Parameters
    ----------
    content
        Of a propagation, of Sobol' indices, of elementary effects or of one spread of a robust optimum.

    Examples
    --------
    >>> effect = {"reason": "", "mu_star": [0.0, 2.0]}
    >>> varying({"effects": {"w": effect, "v": effect | {"mu_star": [0.0, 0.0]}}})
    ({'effects': {'w': {'reason': '', 'mu_star': [0.0, 2.0]}}}, ['v'])
    """
    key = next(key for key in ("outputs", "indices", "effects") if key in content)
    other = (content.get("other") or {}).get("outputs", {})
    kept = {
        name: found
        for name, found in content[key].items()
        if _varies(found) or (name in other and _varies(other[name]))
    }
    only = dict(content) | {key: kept}
    if "convergence" in content:
        only["convergence"] = {name: steps for name, steps in content["convergence"].items() if name in kept}
    return only, [name for name in content[key] if name not in kept]


def constant_note(names: Sequence[str]) -> str:
    """Return the sentence on outputs that no figure shows."""
    return f"No figure of what does not vary: {', '.join(names[:MOST_PANELS])}."


def _varies(found: Mapping[str, Any]) -> bool:
    """Tell whether a summary has a width, or whether there are indices or effects at all."""
    if "statistics" in found:
        mean, std = (found["statistics"][key]["value"] or 0.0 for key in ("mean", "std"))
        return bool(std > ROUNDING * abs(mean))
    return not found["reason"] and any(found.get("mu_star", [1.0]))


def _named_outputs(study: Study) -> Collection[str]:
    """Return the outputs that an analysis names, be it in a formula."""
    words: set[str] = set()
    for entry in study.analyses:
        asked = entry.value.written()
        texts = [str(asked.get("objective", "")), *map(str, asked.get("constraints", ()))]
        for text in texts:
            words |= {name for name in study.output_names if name in text}
        for key in ("outputs", "targets", "limits", "measurements"):
            words |= set(asked.get(key) or ())
    return words


def _spread(Y: np.ndarray) -> np.ndarray:
    """Return the width of each column, 0 where it holds one value or none."""
    finite = np.isfinite(Y)
    high = np.where(finite, Y, -np.inf).max(axis=0, initial=-np.inf)
    low = np.where(finite, Y, np.inf).min(axis=0, initial=np.inf)
    return np.where(finite.any(axis=0), high - low, 0.0)


def _rank_correlation(frame: "pd.DataFrame", inputs: Sequence[str], outputs: Sequence[str]) -> np.ndarray:
    """Return the largest rank correlation of each input with an output, in magnitude."""
    if not outputs or len(frame) < 3:
        return np.zeros(len(inputs))
    some: Any = frame if len(frame) <= MOST_RANKED else frame.iloc[:: -(-len(frame) // MOST_RANKED)]
    ranks = some[[*inputs, *outputs]].rank().to_numpy()
    ranks = np.where(np.isfinite(ranks), ranks, np.nanmean(ranks, axis=0))
    ranks -= ranks.mean(axis=0)
    scale = np.sqrt((ranks**2).sum(axis=0))
    ranks /= np.where(scale > 0.0, scale, 1.0)
    d = len(inputs)
    strength: np.ndarray = np.abs(ranks[:, :d].T @ ranks[:, d:]).max(axis=1)
    return strength
