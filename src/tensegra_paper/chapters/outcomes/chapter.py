"""Fig. 6: how 100,000 random actuations come out, by the stepped procedure and along stable paths."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.mechanics import PathSettings, Status
from tensegra.report import Table
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.chapters.outcomes.figures import outcome_figure
from tensegra_paper.chapters.shapes.pair import ELSEWHERE
from tensegra_paper.claims import CLAIMS, finding
from tensegra_paper.published import published
from tensegra_paper.setting import Setting

__all__ = ["Shape", "classify", "outcomes"]

Array: TypeAlias = NDArray[np.float64]
Shape: TypeAlias = str

UPWARD, HANGING, OFF = "upward", "stable, tip not above its start", "stable, off the path"
BEYOND, UNSTABLE = "spurious root, beyond the law", "does not stand"
COLLAPSED, FAILED = "prestress lost", "not converged"

PRINTED = "irregular (as printed)"

SHAPES: tuple[Shape, ...] = (UPWARD, HANGING, OFF, UNSTABLE, COLLAPSED, BEYOND, FAILED)
"""In the order of the bars."""

IRREGULAR = (HANGING, OFF, UNSTABLE, COLLAPSED, BEYOND)
"""What converged but is not the wanted shape: the publication's 'irregular deformation'.

The publication does not tell roots beyond the law from shapes, so that its count holds them too.
"""

PROCEDURES = {"stepped": PathSettings(path="stepped"), "path": PathSettings()}

N_RUNS = 100_000

GROUPS = {
    "with gravity": (("A14", "A23"), (0.01, 0.10)),
    "without gravity": (("A1", "A2", "A3", "A4"), (0.01, 0.30)),
}
"""Actuators of the two groups of Fig. 6, and their range."""


@dataclass(frozen=True, eq=False)
class Group:
    """One group of actuations, by both procedures.

    Attributes
    ----------
    runs
        By procedure.
    shares
        By procedure and shape, in percent.
    """

    runs: Mapping[str, BeamRuns]
    shares: Mapping[str, Mapping[Shape, float]]


def outcomes(setting: Setting) -> Chapter:
    """Solve the two groups of random actuations of Fig. 6 by both procedures, and count."""
    groups = {name: _group(setting, name) for name in GROUPS}
    printed = {name: _printed(name) for name in GROUPS}
    n_runs = groups["with gravity"].runs["path"].n_runs
    rows = [row for name, group in groups.items() for row in _rows(name, group)]
    return Chapter(
        name="outcomes",
        title="Outcomes of random actuations (Fig. 6)",
        figures=(
            Figure(
                "fig-06-outcomes",
                f"Outcomes of {n_runs} random actuations, (a) with and (b) without gravity. As printed (of "
                "(b) only the irregular share is a number), by the publication's procedure and along stable "
                "paths",
                lambda: outcome_figure(printed, {name: group.shares for name, group in groups.items()}),
            ),
        ),
        rows=tuple(rows),
        text=_text(groups, n_runs),
        findings=_findings(groups),
        tables=tuple(_table(name, group) for name, group in groups.items()),
        seconds={
            f"{procedure} {name}": runs.seconds
            for name, group in groups.items()
            for procedure, runs in group.runs.items()
        },
        seeds={f"actuations {name}": setting.seed_of(f"outcomes {name}") for name in GROUPS},
    )


def _group(setting: Setting, name: str) -> Group:
    actuators, (low, high) = GROUPS[name]
    structure = setting.structure if name == "with gravity" else setting.without_gravity
    rng = np.random.default_rng(setting.seed_of(f"outcomes {name}"))
    n_runs = setting.count(N_RUNS, least=500)
    inputs = {actuator: rng.uniform(low, high, n_runs) for actuator in actuators}
    runs = {
        procedure: setting.runs(f"outcomes-{name.replace(' ', '-')}-{procedure}", structure, inputs, settings)
        for procedure, settings in PROCEDURES.items()
    }
    shares = {}
    for procedure, solved in runs.items():
        shape = classify(solved, runs["path"])
        shares[procedure] = {kind: 100.0 * float(np.mean(shape == kind)) for kind in SHAPES}
    return Group(runs, shares)


def classify(runs: BeamRuns, path: BeamRuns) -> NDArray[np.str_]:
    """Return the shape of each run.

    Parameters
    ----------
    runs
        The runs.
    path
        The same, followed along stable equilibria: what stands and ends elsewhere has left
        the branch. Where the path itself does not stand there is nothing to leave.

    Returns
    -------
    numpy.ndarray
        One of `SHAPES` by run. Upward are the runs that end so, whatever their strain: it is given beside
        them. What does not stand is a shape within small strain alone.
    """
    off = np.linalg.norm(runs.tip - path.tip, axis=2).max(axis=1) > ELSEWHERE
    chosen = [
        (runs.status == Status.FAILED, FAILED),
        (runs.beyond_law & (~runs.stands | (path.stands & off)), BEYOND),
        (runs.status == Status.COLLAPSED, COLLAPSED),
        (~runs.stands, UNSTABLE),
        (path.stands & off, OFF),
        (runs.w <= 0.0, HANGING),
    ]
    return np.select([mask for mask, _ in chosen], [shape for _, shape in chosen], default=UPWARD)


def irregular(shares: Mapping[Shape, float]) -> float:
    """Return the share that converged to another shape than the wanted one, in percent."""
    return sum(shares[shape] for shape in IRREGULAR)


def _printed(name: str) -> dict[str, float]:
    """Return the printed shares; what is given in words alone is left open."""
    kept = published("fem", f"outcomes_{name.replace(' ', '_')}_percent")
    printed = {PRINTED: kept["irregular"]}
    if isinstance(kept["upward"], float):
        return {UPWARD: kept["upward"], **printed, FAILED: kept["not_converged"]}
    return printed


def _rows(name: str, group: Group) -> list[Row]:
    kept = published("fem", f"outcomes_{name.replace(' ', '_')}_percent")
    place = "Fig. 6a" if name == "with gravity" else "Fig. 6b"
    rows = []
    for procedure, shares in group.shares.items():
        ours = {"upward": shares[UPWARD], "irregular": irregular(shares), "not converged": shares[FAILED]}
        for what, share in ours.items():
            quantity, why = f"{what}, {name}, {_BY[procedure]}", _why(name, procedure, what, group)
            printed = kept.get(what.replace(" ", "_"))
            claim = f"{what} {name}"
            if procedure == "stepped" and claim in CLAIMS:
                # The publication's own procedure is what its count is held to.
                rows.append(finding(claim, quantity, share, "%", why, share=share))
            elif procedure == "path" and what == "not converged":
                rows.append(
                    Row(place, quantity, printed, share, "%", Agreement.METHOD, holds=share == 0.0, why=why)
                )
            else:
                rows.append(Row(place, quantity, printed, share, "%", Agreement.VALUE, None, why))
    strains = 100.0 * group.runs["path"].strain[group.runs["path"].stands]
    rows.append(
        Row(
            place,
            f"largest strain of the runs that stand along stable paths, {name}: median and largest",
            "small",
            f"{np.median(strains):.1f}, {strains.max():.1f}",
            "%",
            Agreement.VALUE,
            None,
            f"{100 * np.mean(group.runs['path'].beyond_law[group.runs['path'].stands]):.1f} % of them are "
            "beyond 5 %, where the linear law of the publication no longer describes a material",
        )
    )
    return rows


_BY = {"stepped": "stepped procedure", "path": "along stable paths"}


def _why(name: str, procedure: str, what: str, group: Group) -> str:
    shares = group.shares[procedure]
    if procedure == "path" and what == "not converged":
        return "holds where every run ends in an equilibrium that is proved, or in a located collapse"
    if what == "irregular":
        parts = [f"{shares[kind]:.2f} {kind}" for kind in IRREGULAR if shares[kind] > 0.0]
        return f"consists of {', '.join(parts)}" if parts else "none of any kind"
    if procedure == "path":
        return _why_not_upward(name, group)
    if what == "not converged":
        return "no limit of iterations is printed; ours is 100 an increment, to a residual of 1e-9"
    return (
        "increments of 1 % and plain Newton–Raphson; the coordinates, the limit of iterations and the "
        "treatment of slack cables, on which jumps and divergence depend, are not printed"
    )


def _why_not_upward(name: str, group: Group) -> str:
    """Say what the runs are that do not end upward along stable paths."""
    runs, shares = group.runs["path"], group.shares["path"]
    hanging = classify(runs, runs) == HANGING
    if name == "with gravity" and hanging.any():
        more = np.mean(runs.inputs["A23"][hanging] > runs.inputs["A14"][hanging])
        return (
            f"{shares[HANGING]:.2f} % hang below their start, stable; in {100 * more:.0f} % of these the "
            "bottom cables give way by more than the top ones take up. The weight and the stiffness against "
            "it are the reconstruction's"
        )
    return (
        f"{shares[COLLAPSED]:.2f} % lose their prestress on the way, at a critical point that is located; "
        "where it goes depends on the reconstructed coordinates"
    )


def _text(groups: Mapping[str, Group], n_runs: int) -> tuple[str, ...]:
    return (
        (
            f"{n_runs} random actuations with gravity (A14 and A23 uniform in 1 to 10 %) and {n_runs} "
            "without (A1 to A4 uniform in 1 to 30 %) are solved twice: in increments of 1 % by plain "
            "Newton–Raphson, as the publication does it, and along paths of stable equilibria in adaptive "
            "steps."
        ),
        (
            "The publication counts shapes: upward, irregular, not converged. A status says more, and the "
            "two are kept apart: 'upward' stands and has its tip above its start; 'irregular' is everything "
            "else that converged, whether it hangs, stands off the path by more than 1 mm at the tip, does "
            "not stand at all, or has lost its prestress so that its position is not unique. Ends with a "
            "member beyond 5 % of strain that do not stand, or stand off the path, are spurious roots of the "
            "linear law: they are counted as such, and are no shapes."
        ),
        *(f"{name.capitalize()}: {_disagreement(group)}" for name, group in groups.items()),
    )


def _missed(group: Group) -> tuple[int, Counter[Shape]]:
    """Return how many runs stand along stable paths, and how the stepped procedure misses them."""
    found = group.runs["path"].stands
    reached = classify(group.runs["stepped"], group.runs["path"])[found]
    missed = (FAILED, UNSTABLE, COLLAPSED, OFF, BEYOND)
    return int(found.sum()), Counter({kind: int(np.sum(reached == kind)) for kind in missed})


def _disagreement(group: Group) -> str:
    n_found, missed = _missed(group)
    told = ", ".join(f"{count} {kind}" for kind, count in missed.items() if count)
    return (
        f"of {n_found} runs that stand at the end of their path the stepped procedure misses "
        f"{missed.total()}, that is {100 * missed.total() / n_found:.2f} %" + (f" ({told})." if told else ".")
    )


def _findings(groups: Mapping[str, Group]) -> tuple[str, ...]:
    lost = sum(int(np.sum(group.runs["path"].status == Status.FAILED)) for group in groups.values())
    told = []
    for name, group in groups.items():
        n_found, missed = _missed(group)
        kept = published("fem", f"outcomes_{name.replace(' ', '_')}_percent")["upward"]
        printed = kept if isinstance(kept, str) else f"{kept} %"
        told.append(
            f"{name} {group.shares['path'][UPWARD]:.1f} % end upward (printed {printed}), and of those that "
            f"stand the stepped procedure misses {100 * missed.total() / n_found:.1f} %"
        )
    return (
        f"Along stable paths {lost or 'no'} {'run is' if lost < 2 else 'runs are'} lost: {'; '.join(told)}.",
    )


def _table(name: str, group: Group) -> Table:
    rows = [
        (shape, *(f"{group.shares[procedure][shape]:.2f}" for procedure in PROCEDURES)) for shape in SHAPES
    ]
    milliseconds = [1000.0 * runs.seconds / runs.n_runs for runs in group.runs.values()]
    rows.append(("time of a run, ms", *(f"{value:.3g}" for value in milliseconds)))
    header = ("Outcome", "stepped [%]", "along stable paths [%]")
    return Table.of(f"Outcomes {name}", header, rows, "lrr")
