"""One model for each regime, and the probability of each: a surrogate that knows where not to answer.

A polynomial across the border between taut and slack cables, where the response has a kink, or into the
region where the structure has collapsed, is worth nothing; within a regime the response is smooth.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.outcome import Outcome, train_outcome
from tensegra.surrogate.parts import Part, train_part
from tensegra.surrogate.problem import Problem
from tensegra.surrogate.regimes import STANDING

__all__ = ["Piecewise", "train"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]

FEWEST_RUNS = 20  # for a piece of its own
MANY_RUNS = 3_000  # above, a Gaussian process would take minutes, and the polynomials have all they need
TRIAL_SHARE = 0.2  # of a regime's runs, on which the candidates for its piece are compared
# With many runs in three inputs the error still falls at degree 15.
CANDIDATES: tuple[tuple[str, Mapping[str, Any]], ...] = (("pce", {"max_degree": 16}), ("gpr", {}))


@dataclass(frozen=True, eq=False)
class Piecewise:
    """Probabilities of the regimes, and a piece for each (`tensegra.surrogate.problem.Model`).

    Where the structure more probably than not does not stand, there is no answer: NaN.

    Parameters
    ----------
    outcome
        The probabilities.
    piece_of
        Which piece speaks for each regime of `outcome`, shape (n_regimes,); −1 where nothing stands.
    pieces
        The pieces.
    """

    outcome: Outcome
    piece_of: tuple[int, ...]
    pieces: tuple[Part, ...]

    @property
    def has_std(self) -> bool:
        """Whether every piece knows how far it can be trusted."""
        return all(piece.model.has_std for piece in self.pieces)

    @property
    def regime_names(self) -> tuple[str, ...]:
        """The regimes."""
        return self.outcome.names

    def probabilities(self, Z: Array) -> Array:
        """Return the probability of each regime, shape (n_points, n_regimes)."""
        return self.outcome.probabilities(Z)

    def chosen(self, Z: Array, *, standing: bool = False) -> Indices:
        """Return the regime that is spoken for at each point, as its number.

        It is the most probable one that stands, unless it is more probable that nothing stands; with
        `standing` in any case.
        """
        probability = self.probabilities(Z)
        stands = np.array(self.piece_of) >= 0
        among: Indices = np.where(stands, probability, -1.0).argmax(axis=1)
        if standing or stands.all():
            return among
        fallen = np.where(stands, -1.0, probability).argmax(axis=1)
        return np.asarray(np.where(probability[:, ~stands].sum(axis=1) > 0.5, fallen, among))

    def predict(self, Z: Array) -> Array:
        """Return the outputs, NaN where nothing stands."""
        return self._by_piece("predict", Z, self.chosen(Z))

    def predict_standing(self, Z: Array) -> Array:
        """Return the outputs on the condition that the structure stands."""
        return self._by_piece("predict", Z, self.chosen(Z, standing=True))

    def std(self, Z: Array) -> Array:
        """Return the standard deviations, NaN where nothing stands."""
        return self._by_piece("std", Z, self.chosen(Z))

    def std_standing(self, Z: Array) -> Array:
        """Return the standard deviations on the condition that the structure stands."""
        return self._by_piece("std", Z, self.chosen(Z, standing=True))

    def gradient(self, Z: Array) -> Array:
        """Return the derivatives of the piece that speaks, NaN where nothing stands."""
        return self._by_piece("gradient", Z, self.chosen(Z))

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays and settings; see `from_state`."""
        arrays, outcome = self.outcome.state()
        pieces = []
        for i, piece in enumerate(self.pieces):
            own, settings = piece.state(f"piece_{i}")
            arrays |= own
            pieces.append(settings)
        return arrays, {"outcome": outcome, "piece_of": list(self.piece_of), "pieces": pieces}

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the model that `state` was taken from."""
        return cls(
            Outcome.from_state(arrays, settings["outcome"]),
            tuple(settings["piece_of"]),
            tuple(Part.from_state(arrays, each, f"piece_{i}") for i, each in enumerate(settings["pieces"])),
        )

    def _by_piece(self, method: str, Z: Array, regime: Indices) -> Array:
        """Ask each piece at its points; NaN where none speaks."""
        which = np.array(self.piece_of)[regime]
        n_outputs = len(self.pieces[0].scaling.output_shift)
        shape = (len(Z), n_outputs, Z.shape[1]) if method == "gradient" else (len(Z), n_outputs)
        answer = np.full(shape, np.nan)
        for i, piece in enumerate(self.pieces):
            mine = which == i
            if mine.any():
                answer[mine] = getattr(piece, method)(Z[mine])
        return answer


def train(
    problem: Problem,
    rng: np.random.Generator,
    *,
    piece: str | None = None,
    piece_options: Mapping[str, Any] | None = None,
    hidden: Sequence[int] = (16, 16),
    iterations: int = 600,
) -> Piecewise:
    """Train the outcome on all runs, and a piece on the runs of each regime where that pays.

    Parameters
    ----------
    problem
        The standardised runs; with their `outcomes`, else there is one regime.
    rng
        Source of all that is random.
    piece, piece_options
        Kind and options of the pieces. Left out, polynomials, or for a regime of some thousand runs at most
        a Gaussian process, whichever is nearer to a fifth of its runs that neither has seen.
    hidden, iterations
        Neurons of each hidden layer of the outcome's network, and the limit of its training.

    Returns
    -------
    Piecewise
        The outcome and the pieces. The most frequent regime has a piece of its own; another one has it too,
        unless its runs are few or the first piece is nearer to them.
    """
    if not hidden or min(hidden) < 1:
        raise StudyError.at("piecewise: hidden", hidden, "a number of neurons for each hidden layer")
    candidates = CANDIDATES if piece is None else ((piece, piece_options or {}),)
    if any(kind in {"piecewise", "auto"} for kind, _ in candidates):
        raise StudyError.at("piecewise: piece", piece, "another kind")
    outcomes = problem.outcomes
    if outcomes is None:
        regimes = np.full(len(problem.Z), STANDING)
        outcome = Outcome((STANDING,), ())
    else:
        regimes = outcomes.regimes
        labels = np.concatenate([regimes, outcomes.fallen])
        outcome = train_outcome(
            np.concatenate([problem.Z, outcomes.fallen_Z]), labels, rng, hidden, iterations
        )
    names, counts = np.unique(regimes, return_counts=True)
    pieces: list[Part] = []
    piece_of: dict[str, int] = {}
    for name in names[np.argsort(-counts, kind="stable")]:
        own = _piece(problem, np.flatnonzero(regimes == name), candidates, pieces[:1], rng)
        piece_of[str(name)] = 0 if own is None else len(pieces)
        pieces += [] if own is None else [own]
    return Piecewise(outcome, tuple(piece_of.get(name, -1) for name in outcome.names), tuple(pieces))


def _piece(
    problem: Problem,
    rows: Indices,
    candidates: Sequence[tuple[str, Mapping[str, Any]]],
    others: Sequence[Part],
    rng: np.random.Generator,
) -> Part | None:
    """Return the piece of a regime; None where one of `others` is nearer to its runs."""
    few = len(rows) < FEWEST_RUNS
    if few and others:
        return None
    if few or len(rows) > MANY_RUNS:
        candidates = candidates[:1]
    part = problem.rows(rows)
    if not others and len(candidates) == 1:
        return train_part(candidates[0][0], part, rng, candidates[0][1], own_box=True)
    order = rng.permutation(len(rows))
    n_tried = round(TRIAL_SHARE * len(rows))
    seen, tried = part.rows(np.sort(order[n_tried:])), part.rows(np.sort(order[:n_tried]))
    errors = [
        _distance(train_part(kind, seen, rng, options, own_box=True), tried) for kind, options in candidates
    ]
    best = int(np.argmin(errors))
    if any(_distance(other, tried) <= errors[best] for other in others):
        return None
    return train_part(candidates[best][0], part, rng, candidates[best][1], own_box=True)


def _distance(piece: Part, tried: Problem) -> float:
    """Return the mean logarithm of the outputs' root mean square errors."""
    error = piece.predict(tried.Z) - tried.T
    return float(np.mean(np.log(np.sqrt(np.mean(error**2, axis=0)) + np.finfo(float).tiny)))
