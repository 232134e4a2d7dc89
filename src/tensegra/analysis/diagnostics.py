"""Whether chains have converged, and what their draws are worth.

Rank-normalised split R̂ and the effective sample sizes of bulk and tails, after Vehtari, Gelman, Simpson,
Carpenter & Bürkner (2021), *Bayesian Analysis* 16, 667-718, doi:10.1214/20-BA1221. Draws are (n_chains,
n_draws) of one quantity.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Their recommendations (sections 4.2 and 4.3): below these, draws are not to be relied on.
LARGEST_RHAT = 1.01
SMALLEST_ESS = 400


def rhat(draws: Array) -> float:
    """Return the rank-normalised split R̂, of the draws or of their distance from the middle, the larger.

    Examples
    --------
    >>> chains = np.random.default_rng(1).standard_normal((4, 500))
    >>> rhat(chains) < 1.01, rhat(chains + [[0.0], [0.0], [0.0], [2.0]]) > 1.3
    (True, True)
    """
    folded = np.abs(draws - np.median(draws))
    return max(_split_rhat(_normal_scores(_split(part))) for part in (draws, folded))


def bulk_ess(draws: Array) -> float:
    """Return the effective sample size for the centre of the distribution."""
    return _ess(_normal_scores(_split(draws)))


def tail_ess(draws: Array, tail: float = 0.05) -> float:
    """Return the effective sample size for the quantiles `tail` and 1 − `tail`, the smaller of both."""
    return min(_ess(_split((draws <= np.quantile(draws, p)).astype(float))) for p in (tail, 1.0 - tail))


def _split(draws: Array) -> Array:
    """Return each chain as two; an odd draw in the middle is left out."""
    half = draws.shape[1] // 2
    return np.concatenate([draws[:, :half], draws[:, -half:]])


def _normal_scores(draws: Array) -> Array:
    """Return normal scores of the ranks over all chains (their Eq. 14)."""
    from scipy.special import ndtri
    from scipy.stats import rankdata

    ranks = rankdata(draws, method="average").reshape(draws.shape)
    return np.asarray(ndtri((ranks - 0.375) / (draws.size + 0.25)))


def _split_rhat(chains: Array) -> float:
    n = chains.shape[1]
    within = chains.var(axis=1, ddof=1).mean()
    between = n * chains.mean(axis=1).var(ddof=1)
    if within == 0.0:
        return 1.0 if between == 0.0 else np.inf
    return float(np.sqrt(((n - 1) / n * within + between / n) / within))


def _ess(chains: Array) -> float:
    """Return the effective sample size by Geyer's initial monotone sequence (their section 3.2)."""
    m, n = chains.shape
    if np.ptp(chains) == 0.0:
        return float(m * n)
    covariance = _autocovariance(chains)
    within = covariance[:, 0].mean() * n / (n - 1)
    total = within * (n - 1) / n + (chains.mean(axis=1).var(ddof=1) if m > 1 else 0.0)
    rho = 1.0 - (within - covariance.mean(axis=0) * n / (n - 1)) / total
    rho[0] = 1.0
    n_pairs = n // 2
    pairs = rho[: 2 * n_pairs].reshape(n_pairs, 2).sum(axis=1)
    negative = np.flatnonzero(pairs < 0.0)
    pairs = pairs[: negative[0]] if negative.size else pairs
    tau = -1.0 + 2.0 * float(np.minimum.accumulate(pairs).sum())
    return float(m * n / max(tau, 1.0 / np.log10(m * n)))


def _autocovariance(chains: Array) -> Array:
    """Return the biased autocovariance of each chain, by the fast Fourier transform."""
    n = chains.shape[1]
    centred = chains - chains.mean(axis=1, keepdims=True)
    spectrum = np.fft.rfft(centred, 2 * n, axis=1)
    return np.asarray(np.fft.irfft(spectrum * np.conj(spectrum), 2 * n, axis=1)[:, :n] / n)
