"""How Table 2 is to be read: every combination of what it leaves open, solved and compared with the print."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.beam_model import TIP
from tensegra_paper.five_inputs import ACTUATIONS, TEMPERATURES
from tensegra_paper.published import published, published_number
from tensegra_paper.setting import Setting

__all__ = [
    "EXCHANGED",
    "LAWS",
    "STATISTICS",
    "Reading",
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

N_READING = 16_384
"""Runs of a reading: the scatter of a mean is a hundredth of what the readings differ by."""


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
    node
        The node whose displacement it is, or their mean.
    found
        By law: the seven statistics, shape (7,), cm.
    distance
        Root mean square of ours less the 14 printed numbers, cm.
    """

    exchanged: bool
    temperatures: bool
    shared: bool
    node: str
    found: Mapping[str, Array]
    distance: float

    @property
    def words(self) -> tuple[str, str, str, str]:
        """The four choices in words."""
        return (
            "exchanged" if self.exchanged else "as headed",
            "vary" if self.temperatures else "do not vary",
            "shared" if self.shared else "independent",
            self.node,
        )


def statistics(values: Array) -> Array:
    """Return the seven statistics of Table 2, shape (7,), in its order.

    Examples
    --------
    >>> statistics(np.arange(5.0)).round(2)
    array([2.  , 1.58, 0.  , 4.  , 1.  , 2.  , 3.  ])
    """
    quartiles = np.quantile(values, [0.25, 0.5, 0.75])
    return np.array([values.mean(), values.std(ddof=1), values.min(), values.max(), *quartiles])


def readings(setting: Setting) -> tuple[Reading, ...]:
    """Solve every combination of what Table 2 leaves open, and sort them by their distance from it."""
    rng = np.random.default_rng(setting.seed_of("readings"))
    n_runs = setting.count(N_READING, least=4096)
    found: dict[tuple[bool, bool, str], dict[str, Array]] = {}
    for temperatures, shared in product((True, False), repeat=2):
        for law in LAWS:
            first, second = _error(law, rng, n_runs), _error(law, rng, n_runs)
            inputs = {ACTUATIONS[0]: 0.1 - first, ACTUATIONS[1]: 0.1 - (first if shared else second)}
            if temperatures:
                cold, hot = published("doe", "temperature_range")
                inputs |= {name: rng.uniform(cold, hot, n_runs) for name in TEMPERATURES}
            name = f"table-2-{law}{'-temperatures' * temperatures}{'-shared' * shared}"
            runs = setting.runs(name, setting.structure, inputs)
            for node, w in ((TIP[1], runs.displacement("z", TIP[1])), (" and ".join(TIP), runs.w)):
                found.setdefault((temperatures, shared, node), {})[law] = statistics(w)
    options = [
        Reading(exchanged, *key, by_law, distance(by_law, exchanged=exchanged))
        for key, by_law in found.items()
        for exchanged in (True, False)
    ]
    return tuple(sorted(options, key=lambda reading: reading.distance))


def _error(law: str, rng: np.random.Generator, n_runs: int) -> Array:
    return rng.uniform(0.0, 0.01, n_runs) if law == "uniform" else rng.exponential(0.001, n_runs)


def printed_column(law: str, model: str, *, exchanged: bool = True) -> Array:
    """Return the seven printed statistics of a law by ``fem`` or ``nn``, shape (7,), cm."""
    heading = EXCHANGED[law] if exchanged else HEADINGS[law]
    column = list(published(*TABLE, "columns")).index(f"{heading}_{model}")
    return np.array([published_number(*TABLE, statistic, column) for statistic in STATISTICS])


def distance(found: Mapping[str, Array], *, exchanged: bool) -> float:
    """Return the root mean square of ours less the printed FEM numbers of both laws, cm."""
    each = [found[law] - printed_column(law, "fem", exchanged=exchanged) for law in LAWS]
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
