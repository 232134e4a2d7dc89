"""What an inverse problem returns: inputs along a trajectory, what they reach, and what to expect."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.results import plain
from tensegra.presented import Tabled

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Trajectory(Tabled):
    """Inputs that follow a trajectory of targets; the first axis of all arrays is the waypoint.

    Attributes
    ----------
    name, model, seed, confidence, tolerance
        What was asked; a waypoint is reached where every output misses by no more than `tolerance`.
    input_names, x, bounds
        The designed inputs (n_waypoints, n_designed), and their box.
    held
        By input that is not designed: the number that the search took it at.
    target_names, targets, outputs
        The outputs with targets: wanted, and as the model has them, (n_waypoints, n_targets).
    reached
        Shape (n_waypoints,): by the true model, where there is one.
    low, high
        The interval that each output lies in under the errors and, for a surrogate, its own uncertainty;
        around the true model's answer where there is one.
    laws, n_samples, n_failed
        The errors, in words; the samples of them at each waypoint, and how many failed, (n_waypoints,).
    true_status, true_outputs
        The waypoints solved by the true model; None without one.
    units
        By name.
    """

    kind = "inverse"

    name: str
    model: str
    seed: int
    confidence: float
    tolerance: tuple[float, ...]
    input_names: tuple[str, ...]
    held: Mapping[str, float]
    x: Array
    bounds: Array
    target_names: tuple[str, ...]
    targets: Array
    outputs: Array
    reached: NDArray[np.bool_]
    low: Array
    high: Array
    laws: Mapping[str, str]
    n_samples: int
    n_failed: NDArray[np.intp]
    true_status: tuple[str, ...] | None = None
    true_outputs: Array | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def success(self) -> bool:
        """Whether every waypoint is reached."""
        return bool(self.reached.all())

    @property
    def reason(self) -> str:
        """How far the trajectory is reached, in words."""
        told = f"{int(self.reached.sum())} of {len(self.x)} waypoints reached"
        if self.true_status is not None and set(self.true_status) - {"stable"}:
            told += f"; the true model: {', '.join(self.true_status)}"
        if not self.success:
            reached = self.outputs if self.true_outputs is None else self.true_outputs
            misses = np.abs(reached - self.targets)
            known = [(n, m[np.isfinite(m)]) for n, m in zip(self.target_names, misses.T, strict=True)]
            missed = ", ".join(f"{name} by {found.max():.3g}" for name, found in known if found.size)
            told += f"; within these bounds the others are missed, at most {missed or 'without a result'}"
        return told

    def table(self) -> list[dict[str, Any]]:
        """Return a row per waypoint: inputs, targets, outputs, intervals, and the true model's outputs."""
        rows = []
        for i, x in enumerate(self.x.tolist()):
            row: dict[str, Any] = {"waypoint": i + 1, **dict(zip(self.input_names, x, strict=True))}
            for k, name in enumerate(self.target_names):
                row[f"{name} target"] = float(self.targets[i, k])
                row[name] = float(self.outputs[i, k])
                row[f"{name} low"], row[f"{name} high"] = float(self.low[i, k]), float(self.high[i, k])
                if self.true_outputs is not None:
                    row[f"{name} true"] = float(self.true_outputs[i, k])
            row["reached"] = bool(self.reached[i])
            rows.append(row)
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        return dict(plain(vars(self) | {"kind": self.kind, "success": self.success, "reason": self.reason}))

    def __repr__(self) -> str:
        names = ", ".join(self.input_names)
        return f"Trajectory({names} on {self.model} for {', '.join(self.target_names)}: {self.reason})"
