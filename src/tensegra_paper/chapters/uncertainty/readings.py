"""How Table 2 is to be read: every combination of what it leaves open, solved and compared with the print."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.five_inputs import ACTUATIONS, TEMPERATURES
from tensegra_paper.models import NODE
from tensegra_paper.published import published, published_number
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

__all__ = [
    "EXCHANGED",
    "LAWS",
    "STATISTICS",
    "Reading",
    "lift_by",
    "nearest",
    "printed_column",
    "readings",
    "slope_ratio",
    "statistics",
]

Array: TypeAlias = NDArray[np.float64]

TABLE = ("propagation", "table_2_displacement_z_cm")
STATISTICS = ("mean", "std", "min", "max", "q25", "q50", "q75")

LAWS: dict[str, dict[str, object]] = {
    "uniform": {"uniform": [0.09, 0.10]},
    "exponential": {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}},
}
"""Of A14 = 0.1 − φ: φ uniform on [0, 1 %], by a quasi-random sequence, or exponential of mean 0.1 %."""

HEADINGS = {"uniform": "sobol", "exponential": "exponential"}
"""Of the laws in the printed table."""

EXCHANGED = {"uniform": "exponential", "exponential": "sobol"}
"""The heading under which the numbers of a law are found."""

N_SEEDS = 12
"""Samples of a reading: one number of the table is chance over them, its extremes above all."""

NOT_EXTREME = [i for i, name in enumerate(STATISTICS) if name not in ("min", "max")]


@dataclass(frozen=True)
class Reading:
    """One way to read what Table 2 was made of.

    Attributes
    ----------
    exchanged
        Whether each law's numbers stand under the other's heading.
    temperatures
        Whether the temperatures vary too.
    shared
        Whether A14 and A23 have the same error, as Eq. 9 says.
    samples
        By law: w of one sample by FEM, cm.
    of_both
        Distance of that sample for the mean of nodes 18 and 23, cm.
    distances
        Root mean square of ours less the ten printed numbers that are no extremes, by sample, cm.
    """

    exchanged: bool
    temperatures: bool
    shared: bool
    samples: Mapping[str, Array]
    of_both: float
    distances: tuple[float, ...]

    @property
    def words(self) -> tuple[str, str, str]:
        """The three choices in words."""
        return (
            "exchanged" if self.exchanged else "as headed",
            "vary" if self.temperatures else "do not vary",
            "shared" if self.shared else "independent",
        )

    @property
    def distance(self) -> float:
        """Mean of the distances, cm."""
        return float(np.mean(self.distances))

    @property
    def told(self) -> str:
        """The distance with its spread over the samples, in words."""
        return f"{self.distance:.2f} ± {np.std(self.distances, ddof=1):.2f} cm"


def statistics(values: Array) -> Array:
    """Return the seven statistics of Table 2, shape (7,), in its order.

    Examples
    --------
    >>> statistics(np.arange(5.0)).round(2)
    array([2.  , 1.58, 0.  , 4.  , 1.  , 2.  , 3.  ])
    """
    quartiles = np.quantile(values, [0.25, 0.5, 0.75])
    return np.array([values.mean(), values.std(ddof=1), values.min(), values.max(), *quartiles])


def readings(setting: Setting, network: "Surrogate") -> tuple[Reading, ...]:
    """Make every combination of what Table 2 leaves open, and sort them by their distance from it.

    Parameters
    ----------
    setting
        Gives the seeds and the number of samples.
    network
        Answers for v and w of node 23, within the tolerance of Table 2: by it all samples are taken but the
        first, which is solved by FEM.
    """
    n_runs = setting.count(int(published("propagation", "samples")), least=4096)
    options = []
    for temperatures, shared in product((True, False), repeat=2):
        found: dict[str, list[Array]] = {law: [] for law in LAWS}
        both: dict[str, Array] = {}
        for law in LAWS:
            name = f"table-2-{law}{'-temperatures' * temperatures}{'-shared' * shared}"
            for number in range(N_SEEDS):
                rng = np.random.default_rng([setting.seed_of(name), number])
                inputs = _drawn(law, rng, n_runs, temperatures=temperatures, shared=shared)
                if number == 0:
                    used = {key: column for key, column in inputs.items() if column.any()}
                    runs = setting.runs(name, setting.structure, used)
                    found[law].append(runs.displacement("z", NODE))
                    both[law] = statistics(runs.w)
                else:
                    found[law].append(lift_by(network, np.column_stack(list(inputs.values()))))
        for exchanged in (True, False):
            distances = tuple(
                distance({law: statistics(found[law][k]) for law in LAWS}, exchanged=exchanged)
                for k in range(N_SEEDS)
            )
            first = {law: samples[0] for law, samples in found.items()}
            of_both = distance(both, exchanged=exchanged)
            options.append(Reading(exchanged, temperatures, shared, first, of_both, distances))
    return tuple(sorted(options, key=lambda reading: reading.distance))


def lift_by(network: "Surrogate", X: Array) -> Array:
    """Return w by a surrogate, shape (n_runs,), also a little outside its box, where few samples lie."""
    from tensegra.surrogate import OutsideBoxWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OutsideBoxWarning)
        return np.asarray(network.predict(X)[:, 1])


def _drawn(
    law: str, rng: np.random.Generator, n_runs: int, *, temperatures: bool, shared: bool
) -> dict[str, Array]:
    """Draw the five inputs; temperatures that do not vary are zero, as in the paper's first studies."""
    first, second = error_of(law, rng, n_runs), error_of(law, rng, n_runs)
    cold, hot = published("doe", "temperature_range") if temperatures else (0.0, 0.0)
    inputs = {ACTUATIONS[0]: 0.1 - first, ACTUATIONS[1]: 0.1 - (first if shared else second)}
    return inputs | {name: rng.uniform(cold, hot, n_runs) for name in TEMPERATURES}


def error_of(law: str, rng: np.random.Generator, n_runs: int) -> Array:
    """Draw the error φ of a law, shape (n_runs,)."""
    return rng.uniform(0.0, 0.01, n_runs) if law == "uniform" else rng.exponential(0.001, n_runs)


def printed_column(law: str, model: str, *, exchanged: bool = True) -> Array:
    """Return the seven printed statistics of a law by ``fem`` or ``nn``, shape (7,), cm."""
    heading = EXCHANGED[law] if exchanged else HEADINGS[law]
    column = list(published(*TABLE, "columns")).index(f"{heading}_{model}")
    return np.array([published_number(*TABLE, statistic, column) for statistic in STATISTICS])


def distance(found: Mapping[str, Array], *, exchanged: bool) -> float:
    """Return the root mean square of ours less the printed FEM numbers of both laws, without extremes, cm."""
    each = [(found[law] - printed_column(law, "fem", exchanged=exchanged))[NOT_EXTREME] for law in LAWS]
    return float(np.sqrt(np.mean(np.concatenate(each) ** 2)))


def slope_ratio(means: Mapping[str, float], stds: Mapping[str, float]) -> float:
    """Return Σ slope² / (Σ slope)² of w by the errors of A14 and A23, from means and deviations alone.

    With φ in percent, the two laws have means 0.5 and 0.1 and variances 1/12 and 1/100. The difference of the
    means of w is then 0.4 Σ slope; that of its variances, in which the temperatures cancel, is
    (1/12 − 1/100) times (Σ slope)² for a shared error and times Σ slope² for independent ones. So the ratio
    is 1 if the error is shared, and between 1/2 and 1 if it is not.

    Examples
    --------
    >>> means, stds = {"uniform": 50.0, "exponential": 52.0}, {"uniform": 5 / 12**0.5, "exponential": 0.5}
    >>> round(slope_ratio(means, stds), 6)
    1.0
    """
    slopes = (means["exponential"] - means["uniform"]) / 0.4
    squares = (stds["uniform"] ** 2 - stds["exponential"] ** 2) / (1 / 12 - 1 / 100)
    return squares / slopes**2


def nearest(options: Sequence[Reading], **wanted: bool) -> Reading:
    """Return the nearest of the readings that have some properties."""
    return next(r for r in options if all(getattr(r, key) == value for key, value in wanted.items()))
