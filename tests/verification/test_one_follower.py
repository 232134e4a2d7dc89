"""One follower: a path's word and its end depend on the structure and on what acts, on nothing else.

Not on the first step, on how far a step may go or on when Newton's method is cut short; not on whether a
run is solved alone, among others, in which order or on how many threads. And the word is true: an own,
dense and slow continuation (`continuation.py`) that cannot leap unseen says which runs leapt, and where.
"""

import numpy as np
import pytest
import random_structures
from continuation import SNAP, Walker
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st

from tensegra.mechanics import PathSettings, solve_batch, solve_path
from tensegra.structure import Member, Structure

SAME_POSITION = 1e-7
"""Of the size, where K is not nearly singular."""

RESIDUAL = 1e-9
"""What the package promises, of the largest force: over the lowest eigenvalue it is a distance."""

LOCATION = 1e-5
"""Of the way: where a branch ends; the follower locates it to 1e-6, and the largest step is no bound."""

DOUBTFUL_SNAP = 4.0
"""A snap within this factor of the threshold may be called one or not."""

DOUBTFUL_END = 1e-6
"""Of the way: a branch that ends so near to the end of the way may be said to end or not."""

ALONE = 4
"""Runs of a case that `solve_batch` also solves one by one."""

STANDS = ("stable", "snapped")

STEP_CONTROLS = {
    "default": PathSettings(),
    "small steps": PathSettings(first_step=0.005, largest_move=0.01),
    "large steps": PathSettings(first_step=0.5, largest_move=0.5, contraction=0.7),
}

FAMILIES = {
    "beam": random_structures.beam,
    "x_frame": random_structures.x_frame,
    "von_mises": random_structures.von_mises,
    "net": random_structures.net,
    "prism": random_structures.prism,
    "ball": random_structures.ball,
    "kite": random_structures.kite,
    "d_bar": random_structures.d_bar,
}

plain = settings(
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],  # a smaller seed is no smaller structure
    suppress_health_check=[HealthCheck.too_slow],
)

step_controls = st.builds(
    PathSettings,
    first_step=st.floats(np.log(1e-3), np.log(0.5)).map(lambda x: float(np.exp(x))),
    largest_move=st.floats(np.log(0.005), np.log(0.5)).map(lambda x: float(np.exp(x))),
    contraction=st.floats(0.1, 0.7),
)


def case_of(family, seed, n_runs):
    return FAMILIES[family](np.random.default_rng(seed), n_runs)


def is_doubtful(path, size):
    """Tell whether a path has a snap near the threshold, or loses its stability at its very end."""
    low, high = SNAP * size / DOUBTFUL_SNAP, SNAP * size * DOUBTFUL_SNAP
    return any(
        low < point.snap < high or point.parameter > 1.0 - DOUBTFUL_END for point in path.critical_points
    )


def tolerance(path, size):
    """Return how far apart two solutions of the same equilibrium may be."""
    forces = max(np.abs(path.final.tensions).max(), *map(abs, _all_loads(path)), 0.0)
    return SAME_POSITION * size + RESIDUAL * forces / path.final.lowest_eigenvalue


def _all_loads(path):
    return [force for stage in path.structure.stages for load in stage.loads.values() for force in load]


def difference(path, size, status, nodes):
    """Tell in what a run differs from a path; None where in nothing, or where the path leaves a doubt."""
    if is_doubtful(path, size):
        return None
    if str(status) != str(path.status):
        return f"{status}, not {path.status}"
    if str(status) not in STANDS:
        return None
    apart = np.abs(nodes - path.final.nodes).max()
    return None if apart <= tolerance(path, size) else f"{apart / size:.2g} of the size apart"


def solved(case, control, order):
    """Yield run, how it was solved, status, reason and nodes, of every run in every way to ask for it.

    By `solve_path`, by `solve_batch` among the others in this order, and for the first few also alone.
    """
    together = solve_batch(case.structure, **case.batch(order), settings=control, threads=1)
    two = solve_batch(case.structure, **case.batch(order), settings=control, threads=2)
    for quantity in ("status", "reason", "nodes", "tensions", "lowest_eigenvalue", "steps", "iterations"):
        np.testing.assert_array_equal(getattr(two, quantity), getattr(together, quantity))
    for place, run in enumerate(order):
        yield run, "among others", together.status[place], together.reason[place], together.nodes[place]
    for run in range(case.n_runs):
        path = solve_path(case.structure, **case.inputs(run), settings=control)
        yield run, "path", path.status, path.reason, path.final.nodes
    for run in range(min(case.n_runs, ALONE)):
        runs = solve_batch(case.structure, **case.batch([run]), settings=control, threads=1)
        yield run, "alone", runs.status[0], runs.reason[0], runs.nodes[0]


def disagreements(case, controls, rng):
    """Return a line for every run whose word or end is not that of `solve_path` with the default settings."""
    expected = [solve_path(case.structure, **case.inputs(run)) for run in range(case.n_runs)]
    found = []
    for name, control in controls.items():
        for run, how, status, reason, nodes in solved(case, control, rng.permutation(case.n_runs)):
            if differs := difference(expected[run], case.size, status, nodes):
                found.append(f"run {run} {how}, {name}: {differs} ({reason or expected[run].reason})")
    return found


def contradictions(case):
    """Return every run whose word the independent walk contradicts, and how many walks there were."""
    found, n_walks = [], 0
    for run in range(case.n_runs):
        path = solve_path(case.structure, **case.inputs(run))
        if str(path.stages[-1].status) not in STANDS or is_doubtful(path, case.size):
            continue
        walk = Walker(case.structure, **case.inputs(run)).walk(path.stages[-1].nodes)
        n_walks += 1
        status = str(path.actuation.status)
        if walk.is_continuous:
            apart = np.abs(walk.nodes - path.final.nodes).max()
            if status != "stable":
                found.append(f"run {run}: {status}, but nothing leaps ({path.reason})")
            elif not apart <= tolerance(path, case.size):
                found.append(f"run {run}: stable, {apart / case.size:.2g} of the size from the branch")
        elif walk.leaps:
            told = [point.parameter for point in path.critical_points if point.stage == "actuation"]
            untold = [where for where in walk.leaps if not any(abs(t - where) < LOCATION for t in told)]
            if status == "stable":
                found.append(f"run {run}: stable, but leaps at {walk.leaps}")
            elif status == "snapped" and untold:
                # Where the prestress fades, a collapse has no sharp place.
                found.append(f"run {run}: snapped at {told}, but leaps also at {untold}")
    return found, n_walks


def ends_around_a_leap(case, run, n_ends=11):
    """Return where the walk of a run first leaps, and ends of the way before it and beyond it.

    An actuation in proportion is a part of the whole way: its path is that of the whole, cut short.
    """
    start = solve_path(case.structure).final
    assert str(start.status) == "stable"
    walk = Walker(case.structure, **case.inputs(run)).walk(start.nodes)
    before = np.linspace(0.0, walk.leaps[0] - LOCATION, n_ends + 1)[1:]
    return before, np.linspace(walk.leaps[0] + LOCATION, 1.0, n_ends)


def words_at(case, run, ends):
    """Return the words of the ways that end at some shares of a run's, one by one and as a batch."""
    actuation, loads = ({name: value * ends for name, value in group.items()} for group in _inputs(case, run))
    batch = solve_batch(case.structure, actuation=actuation, loads=loads, threads=1).status
    return [str(_at(case, run, end).status) for end in ends], [str(status) for status in batch]


def _inputs(case, run):
    inputs = case.inputs(run)
    return inputs["actuation"], inputs["loads"]


def _at(case, run, end):
    actuation, loads = ({name: value * end for name, value in group.items()} for group in _inputs(case, run))
    return solve_path(case.structure, actuation, loads=loads)


@pytest.mark.parametrize("share", [0.9, 0.999, 1.001, 1.5])
def test_the_walk_itself_leaps_where_a_truss_of_von_mises_does(share):
    height, EA = 0.3, 1e4
    rest_length = np.hypot(1.0, height)
    truss = Structure(
        name="truss",
        nodes={"l": (-1, 0, 0), "r": (1, 0, 0), "t": (0, 0, height)},
        members={
            "a": Member("strut", ("l", "t"), rest_length, stiffness=EA),
            "b": Member("strut", ("t", "r"), rest_length, stiffness=EA),
        },
        supports={"l": "xyz", "r": "xyz", "t": "xy"},
    )
    # P = 2 EA (1/ℓ − 1/ℓ₀) z is largest where ℓ³ = ℓ₀.
    length = rest_length ** (1.0 / 3.0)
    limit = 2.0 * EA * (1.0 / length - 1.0 / rest_length) * np.sqrt(length**2 - 1.0)
    walk = Walker(truss, {}, {("t", "z"): -share * limit}).walk(truss.coordinates)
    assert walk.is_continuous is (share < 1.0)
    assert walk.leaps == ([] if share < 1.0 else [pytest.approx(1.0 / share, abs=LOCATION)])


@pytest.mark.parametrize("family", FAMILIES)
@settings(plain, max_examples=2)
@example(seed=3, drawn=PathSettings())
@given(seed=st.integers(0, 2**32 - 1), drawn=step_controls)
def test_the_word_and_the_end_are_the_same_for_any_steps_and_for_one_and_many(family, seed, drawn):
    case, rng = case_of(family, seed, n_runs=2), np.random.default_rng(seed)
    assert disagreements(case, {**STEP_CONTROLS, "drawn": drawn}, rng) == []


@pytest.mark.parametrize(
    ("family", "seed"),
    [("x_frame", 155), ("von_mises", 10), ("von_mises", 25), ("prism", 140), ("beam", 4)],
)
def test_structures_whose_word_or_end_once_depended_on_the_steps(family, seed):
    # Among them two where the same fold was left for different places, by steps of the fall.
    case = case_of(family, seed, n_runs=4)
    assert disagreements(case, STEP_CONTROLS, np.random.default_rng(seed)) == []


@pytest.mark.parametrize("family", FAMILIES)
@settings(plain, max_examples=2)
@example(seed=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_run_is_stable_if_and_only_if_nothing_leaps_on_the_way(family, seed):
    found, _ = contradictions(case_of(family, seed, n_runs=1))
    assert found == []


@pytest.mark.parametrize(
    ("family", "seed", "run"),
    [
        ("beam", 10, 1),
        ("x_frame", 8, 2),
        ("von_mises", 3, 1),
        ("von_mises", 10, 3),
        ("von_mises", 15, 0),
        ("prism", 10, 1),
        ("prism", 15, 1),
    ],
)
def test_the_word_is_one_before_a_leap_and_another_at_every_end_beyond_it(family, seed, run):
    case = case_of(family, seed, n_runs=4)
    before, beyond = ends_around_a_leap(case, run)
    for words in words_at(case, run, before):
        assert words == ["stable"] * len(before)
    for words in words_at(case, run, beyond):
        # What follows a snap may collapse; nothing undoes the snap.
        assert set(words) <= {"snapped", "collapsed"}, words


def test_the_stages_alone_are_the_same_for_any_steps():
    for family, make in FAMILIES.items():
        structure = make(np.random.default_rng(0), 1).structure
        paths = {name: solve_path(structure, settings=control) for name, control in STEP_CONTROLS.items()}
        assert {str(path.status) for path in paths.values()} == {"stable"}, family
        for path in paths.values():
            apart = np.abs(path.final.nodes - paths["default"].final.nodes).max()
            assert apart <= tolerance(path, np.ptp(structure.coordinates, axis=0).max())


def test_nets_of_cables_never_snap():
    # Their energy is convex, so that no equilibrium lies below another.
    for seed in range(10):
        case = random_structures.net(np.random.default_rng(seed), 8)
        runs = solve_batch(case.structure, **case.batch(slice(None)))
        assert set(runs.status) <= {"stable", "collapsed"}


SLOW = {"x_frame": 250, "von_mises": 250, "net": 250, "prism": 250}
"""Structures of each family, of four runs each."""

PARTS = 5
"""Tests among which they are shared."""


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.parametrize("family", SLOW)
def test_a_thousand_runs_of_each_family(family, part):
    found = {}
    for seed in range(part, SLOW[family], PARTS):
        case = case_of(family, seed, n_runs=4)
        if disagreed := disagreements(case, STEP_CONTROLS, np.random.default_rng(seed)):
            found[seed] = disagreed
    assert found == {}


@pytest.mark.slow
@pytest.mark.parametrize("part", range(20))
def test_two_thousand_runs_of_the_beam(part):
    case = case_of("beam", part, n_runs=100)
    assert disagreements(case, STEP_CONTROLS, np.random.default_rng(part)) == []


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_hundreds_of_walks_of_each_family(family):
    found, n_walks = {}, 0
    for seed in range(1000, 1025 if family == "beam" else 1100):
        contradicted, n = contradictions(case_of(family, seed, n_runs=4))
        n_walks += n
        if contradicted:
            found[seed] = contradicted
    assert n_walks > (50 if family == "beam" else 200)
    assert found == {}
