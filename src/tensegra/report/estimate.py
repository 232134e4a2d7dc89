"""What follows the runs of a study: how many points each surrogate learns and each analysis asks for.

The time of a run is known from a probe, and so what an analysis of the structure itself takes; a surrogate
answers in so little that its points are told, and no time.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from tensegra.report.pipeline import HELD_OUT
from tensegra.report.study_tables import title_of
from tensegra.report.tables import Table
from tensegra.study import AnalysisEntry, Study
from tensegra.study.analyses import TRUTH
from tensegra.study.cost import Probe, duration

__all__ = ["Expected", "estimate", "estimate_table"]

STEPS_PER_START = 40
"""Evaluations of a search by gradients from one start, as a rule; hard ones take twice as many."""

STEPS_PER_DRAW = 16
"""Evaluations behind one draw of a posterior, along a path of Hamilton's equations."""


@dataclass(frozen=True)
class Expected:
    """What a surrogate or an analysis will ask for.

    Attributes
    ----------
    name, kind, model
        Which it is, and what it asks: ``runs`` for a surrogate, which learns from those of the campaign.
    n_points
        Points that it asks for, about.
    seconds
        What the structure itself takes for them; None where a surrogate answers.
    """

    name: str
    kind: str
    model: str
    n_points: int
    seconds: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return asdict(self)


def estimate(study: Study, cost: Probe) -> list[Expected]:
    """Return what the surrogates and the analyses of a study will ask for, in their order."""
    parts = []
    for name, surrogate in study.surrogates.items():
        held = surrogate.validation_size or round(HELD_OUT * study.n_points)
        n_train = min(surrogate.training_size or study.n_points, max(study.n_points - held, 0))
        parts.append(Expected(name, surrogate.kind, "runs", n_train, None))
    for i, entry in enumerate(study.analyses):
        for model, n_points in _asked(entry, study.space.n_inputs).items():
            seconds = n_points * cost.seconds_per_run if model == TRUTH else None
            parts.append(Expected(title_of(entry, i), entry.kind, model, n_points, seconds))
    return parts


def estimate_table(parts: list[Expected]) -> Table:
    """List what follows the runs."""
    rows = [
        (
            part.name,
            part.kind,
            part.model,
            part.n_points,
            "" if part.seconds is None else duration(part.seconds),
        )
        for part in parts
    ]
    header = ("After the runs", "Kind", "Asks", "Points", "About")
    return Table.of("What follows", header, rows, "lllrr")


def _asked(entry: AnalysisEntry, d: int) -> dict[str, int]:
    """Return how many points an analysis asks of each of its models, about."""
    asked = entry.value
    if entry.optimisation:
        return _searched(entry)
    counts = {
        "propagation": lambda: asked.samples,
        "sensitivity": lambda: asked.samples * (2 * d + 2 if asked.second_order else d + 2),
        "morris": lambda: asked.trajectories * (d + 1),
        "robust": lambda: asked.starts * STEPS_PER_START * asked.draws + 2 * asked.samples,
        "inverse": lambda: _waypoints(asked.targets) * (asked.starts * STEPS_PER_START + asked.samples),
        "calibration": lambda: asked.chains * (asked.warmup + asked.draws) * STEPS_PER_DRAW,
    }
    count = 0 if entry.sensitivity and asked.method == "chaos" else counts[entry.kind]()
    models = [asked.model, getattr(asked, "compare_with", None)]
    return {model: count for model in models if model}


def _searched(entry: AnalysisEntry) -> dict[str, int]:
    """Return the points of a search by each of its methods; ``direct`` asks the structure itself."""
    asked = entry.value
    counts: dict[str, int] = {}
    for method in asked.methods:
        model = TRUTH if method == "direct" else asked.model
        count = asked.evaluations if method == "bayesian" else asked.starts * STEPS_PER_START
        counts[model] = counts.get(model, 0) + count
    return counts


def _waypoints(targets: Mapping[str, object]) -> int:
    return max((len(values) for values in targets.values() if isinstance(values, tuple)), default=1)
