"""From what a beam answers to the value of each finding."""

from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.identification.responses import (
    Effort,
    Responses,
    design_blocks,
    law_inputs,
    quadratic_terms,
    total_indices,
)

__all__ = ["measure"]

Array: TypeAlias = NDArray[np.float64]

GAP_AFTER = 18.22
"""Of the gripper, cm, as printed: its unprinted radius is taken for it."""


def measure(found: Responses, effort: Effort) -> dict[str, float]:
    """Return the measured value of each finding that the responses hold, NaN where the beam has none."""
    values = _design(found, effort) | _near(found)
    if found.edges:
        values |= _optimum(found)
    if found.outcomes:
        values |= _far(found)
    return values


def _near(found: Responses) -> dict[str, float]:
    v, w = np.abs(found.nominal[:, 0]), found.nominal[:, 1]
    return {
        "w grows": float(np.diff(w, prepend=0.0).min()),
        "v grows": float(np.diff(v, prepend=0.0).min()),
    }


@cache
def _laws(n: int) -> dict[str, Array]:
    return {law: quadratic_terms(inputs) for law, inputs in law_inputs(n).items()}


@cache
def _blocks(n: int) -> Array:
    return np.stack([quadratic_terms(block) for block in design_blocks(n)])


def _design(found: Responses, effort: Effort) -> dict[str, float]:
    values: dict[str, float] = {}
    by_v, by_w = found.polynomial["23"].T
    for law, terms in _laws(effort.samples).items():
        w = found.samples[law] if found.samples else terms @ by_w
        quartiles = np.quantile(w, [0.25, 0.5, 0.75])
        centred = (w - w.mean()) / w.std()
        skew, kurtosis = float((centred**3).mean()), float((centred**4).mean()) - 3.0
        for name, value in zip(
            ("mean", "std", "q25", "q50", "q75"), (w.mean(), w.std(), *quartiles), strict=True
        ):
            values[f"{law} {name}"] = float(value)
        values |= {f"{law} min": float(w.min()), f"{law} max": float(w.max())}
        if law == "uniform":
            values["uniform: normal"] = max(abs(skew), abs(kurtosis))
        else:
            values["exponential: skew"] = skew
    if found.five is None:
        blocks = _blocks(256)
        on_v, on_w = total_indices(blocks @ by_v), total_indices(blocks @ by_w)
    else:
        on_v, on_w = found.five
    share_v, share_w = on_v[2:].sum(), on_w[2:].sum()
    values |= {
        "T on v": float(share_v),
        "T on w above v": float(share_w / share_v),
        "T_top first on w": float(on_w[2] / max(on_w[3], on_w[4])),
        "actuation over T": float(min(on[:2].sum() / on[2:].sum() for on in (on_v, on_w))),
        "T_bottom": float(max(on_v[4], on_w[4])),
        "A14 on w": float(on_w[0]),
        "A14 on v": float(on_v[0] / on_w[0]),
        "A23 on v": float(on_v[1] / np.delete(on_v, 1).max()),
    }
    return values


def _optimum(found: Responses) -> dict[str, float]:
    edge = found.corner
    sign = np.sign(edge.v[-1]) if np.isfinite(edge.v[-1]) else np.nan
    a4, w = edge.at(sign)
    inside = [other.at(sign)[1] for other in found.edges.values() if other is not edge]
    values = {
        "w at v = 1.00": w,
        "A4 at v = 1.00": a4,
        "w at v = 0": edge.at(0.0)[1],
        **({"corner is best": float(w - max(inside))} if inside else {}),
        "v left": float(1.0 / abs(edge.v[-1])),
    }
    values["area before"] = _area_before(edge.tip[16], edge.tip[-1])  # A4 = 0.16, and 0.30
    return values


def _area_before(after: Array, before: Array) -> float:
    """Return the square between the tips of four beams whose radius gives the printed gap after, cm².

    Parameters
    ----------
    after, before
        Coordinates of the nodes of the tip, shape (2, 3).
    """
    (first, normal), (start, turned) = (_edge_line(tip) for tip in (after, before))
    radius = (GAP_AFTER / 2.0 + first @ normal) / normal[0]
    distance = radius * turned[0] - start @ turned
    return float((2.0 * distance) ** 2)


def _edge_line(tip: Array) -> tuple[Array, Array]:
    """Return a point and the normal, pointing inwards, of the tip's edge in the plane of (z, y)."""
    ends = tip[:, [2, 1]]
    along = ends[1] - ends[0]
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    return ends[0], normal * np.sign(normal[0])


def _far(found: Responses) -> dict[str, float]:
    values: dict[str, float] = {}
    for name, key in (("6a", "6a"), ("6b", "6b")):
        upward, irregular, failed = found.outcomes[key]
        values |= {f"{name} upward": float(upward), f"{name} irregular": float(irregular)}
        if name == "6a":
            values["6a not converged"] = float(failed)
    values["runs kept"] = float(100.0 - found.outcomes["4.1"][2])
    on_w = found.four[1]
    values["top over bottom"] = float(min(on_w[0], on_w[3]) / max(on_w[1], on_w[2]))
    return values
