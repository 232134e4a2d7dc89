"""How far a surrogate is from the truth, measured on runs that it has not seen.

The source paper measures Eq. (7) and Eq. (8); the usual coefficient of determination, the largest error and
the coverage of the 90 % interval stand beside them, because Eq. (8) alone does not see a prediction that
varies as much as the truth but elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError

__all__ = ["HALF_WIDTH_90", "Validation", "fold_indices", "measure"]

Array: TypeAlias = NDArray[np.float64]

HALF_WIDTH_90 = 1.6448536269514722  # the 95 % quantile of the standard normal law
IN_UNITS = ("mean_abs_error", "rms_error", "max_abs_error")  # measured in the output's unit


@dataclass(frozen=True, kw_only=True)
class Validation:
    r"""The error of a surrogate on runs that were kept from it; a number per output.

    Parameters
    ----------
    method
        How the runs were kept apart: ``"held out 2500"`` or ``"5-fold"``.
    n_train, n_validation
        Number of runs trained on (of each fold, the smallest) and compared with.
    output_names
        The outputs, in the order of all numbers below.
    relative_error
        Eq. (7), mean of \|q̂ − q\|/\|q\|, as a fraction; infinite where a true value is zero.
    normalised_error
        mean \|q̂ − q\| / mean \|q\|: the like that survives zeros.
    r2_paper
        Eq. (8), Σ(q̂ − q̄)²/Σ(q − q̄)², which is 1 for a perfect surrogate but can exceed 1.
    r2
        The usual 1 − Σ(q̂ − q)²/Σ(q − q̄)².
    mean_abs_error, rms_error, max_abs_error
        Mean, root mean square and largest \|q̂ − q\|, in the output's unit: what an error is where the output
        passes zero and a relative one says nothing.
    coverage_90
        Share of runs inside the surrogate's 90 % interval, or None without standard deviations.
    outcome_right
        Share of design points, standing or not, whose regime was predicted right; None where the surrogate
        or the runs know of none. The errors above are then those of the runs that stand.
    """

    method: str
    n_train: int
    n_validation: int
    output_names: tuple[str, ...]
    relative_error: tuple[float, ...]
    normalised_error: tuple[float, ...]
    r2_paper: tuple[float, ...]
    r2: tuple[float, ...]
    mean_abs_error: tuple[float, ...]
    rms_error: tuple[float, ...]
    max_abs_error: tuple[float, ...]
    coverage_90: tuple[float, ...] | None = None
    outcome_right: float | None = None

    @property
    def error(self) -> float:
        """The largest `normalised_error` of any output: one number to compare surrogates by."""
        return max(self.normalised_error)

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as plain JSON values; a number that is not finite becomes a string."""
        plain: dict[str, Any] = {}
        for name, value in vars(self).items():
            if isinstance(value, tuple):
                plain[name] = [v if isinstance(v, str) or np.isfinite(v) else str(v) for v in value]
            else:
                plain[name] = value
        return plain

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Self:
        """Build from what `to_dict` returned."""
        values = dict(plain)
        for name, value in values.items():
            if name == "output_names":
                values[name] = tuple(value)
            elif isinstance(value, list):
                values[name] = tuple(float(v) for v in value)
        return cls(**values)

    def rows(self) -> list[dict[str, Any]]:
        """Return one row per output, for a table."""
        measures = ("relative_error", "normalised_error", "r2_paper", "r2", *IN_UNITS, "coverage_90")
        return [
            {"output": name}
            | {m: None if getattr(self, m) is None else getattr(self, m)[i] for m in measures}
            | {"n_train": self.n_train, "n_validation": self.n_validation}
            for i, name in enumerate(self.output_names)
        ]

    def summary(self) -> str:
        """Return the largest error of any output in a few words."""
        text = f"error {max(self.relative_error):.1e} relative (Eq. 7, {self.method})"
        if self.outcome_right is not None:
            text += f", outcome right for {self.outcome_right:.2%}"
        return text

    def lines(self, units: Sequence[str]) -> list[str]:
        """Return a line of text per output."""
        lines = []
        for row, unit in zip(self.rows(), units, strict=True):
            mean, rms, largest = (f"{row[name]:.2e} {unit}".rstrip() for name in IN_UNITS)
            line = (
                f"{row['output']:<16} {row['relative_error']:.2e} relative (Eq. 7), "
                f"R² {row['r2']:.6f} (Eq. 8: {row['r2_paper']:.6f}), "
                f"mean {mean}, root mean square {rms}, largest {largest}"
            )
            if row["coverage_90"] is not None:
                line += f", 90 % interval covers {row['coverage_90']:.1%}"
            lines.append(line)
        return lines


def measure(
    Y: Array,
    prediction: Array,
    std: Array | None,
    *,
    method: str,
    n_train: int,
    output_names: Sequence[str],
) -> Validation:
    """Compare predictions with the truth.

    Parameters
    ----------
    Y, prediction
        True and predicted outputs, shape (n_points, n_outputs).
    std
        Standard deviations of the predictions, the same shape, or None.
    method, n_train, output_names
        As in `Validation`.

    Returns
    -------
    Validation
        The measures of each output.

    Examples
    --------
    >>> Y = np.array([[1.0], [2.0], [4.0]])
    >>> v = measure(Y, 1.01 * Y, None, method="held out 3", n_train=9, output_names=["w"])
    >>> v.summary()
    'error 1.0e-02 relative (Eq. 7, held out 3)'
    """
    error = np.abs(prediction - Y)
    size, mean = np.abs(Y), Y.mean(axis=0)
    total = np.sum((Y - mean) ** 2, axis=0)
    # Zeros among the true values, or a constant output, make a measure infinite or undefined, not an error.
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(error == 0, 0.0, error / size).mean(axis=0)
        found = {
            "relative_error": relative,
            "normalised_error": np.where(error.any(axis=0), error.mean(axis=0) / size.mean(axis=0), 0.0),
            "r2_paper": np.sum((prediction - mean) ** 2, axis=0) / total,
            "r2": 1 - np.sum(error**2, axis=0) / total,
            "mean_abs_error": error.mean(axis=0),
            "rms_error": np.sqrt(np.mean(error**2, axis=0)),
            "max_abs_error": error.max(axis=0),
        }
    covered = None if std is None else np.mean(error <= HALF_WIDTH_90 * std, axis=0)
    measures = {name: tuple(map(float, value)) for name, value in found.items()}
    return Validation(
        method=method,
        n_train=n_train,
        n_validation=len(Y),
        output_names=tuple(output_names),
        relative_error=measures["relative_error"],
        normalised_error=measures["normalised_error"],
        r2_paper=measures["r2_paper"],
        r2=measures["r2"],
        mean_abs_error=measures["mean_abs_error"],
        rms_error=measures["rms_error"],
        max_abs_error=measures["max_abs_error"],
        coverage_90=None if covered is None else tuple(map(float, covered)),
    )


def fold_indices(n_points: int, n_folds: int, rng: np.random.Generator) -> list[NDArray[np.intp]]:
    """Deal the points at random into folds whose sizes differ by one at most.

    Raises
    ------
    StudyError
        If there are fewer than two folds, or fewer than two points in a fold.
    """
    if n_folds < 2 or n_points < 2 * n_folds:
        raise StudyError.at("validation", f"{n_folds}-fold", f"2 to {n_points // 2} folds of {n_points} runs")
    return [np.sort(fold) for fold in np.array_split(rng.permutation(n_points), n_folds)]
