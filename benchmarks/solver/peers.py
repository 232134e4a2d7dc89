"""Other programs on the same structure in the same process: their tip beside ours, and the time.

Each peer is an optional package (``pip install tensegra[peers]``); one that is not installed says so.
They are given what helps them: rest lengths, stiffnesses and loads of the last equilibrium, positions
at the start, and fictitious masses that make every mode about as fast as the others.
"""

import importlib
import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from benchmarks.solver.timing import Stopwatch, one_blas_thread
from tensegra.mechanics import EquilibriumPath, solve_path
from tensegra.mechanics.arrays import FloatArray, StructureArrays, structure_arrays
from tensegra.report.tables import Table
from tensegra.structure import Structure, library

__all__ = ["PeerRow", "Peers", "measure_peers"]

MOST_STEPS = 200_000
"""Steps after which a relaxation is given up."""

RELAXED = 1e-8
"""Residual, as a share of the largest tension, at which a relaxation stops; ours go to 1e-9."""


@dataclass(frozen=True)
class PeerRow:
    """One program on one structure.

    Attributes
    ----------
    program, structure
        Which, with its version; what.
    outcome
        What came of it, in words.
    seconds, our_seconds
        Processor time of one solution from the start; NaN where there is none.
    tip, our_tip
        Largest displacement component of any node, with its sign, unit of length.
    difference
        Largest difference of a coordinate, as a share of the structure's size.
    """

    program: str
    structure: str
    outcome: str
    seconds: float = float("nan")
    our_seconds: float = float("nan")
    tip: float = float("nan")
    our_tip: float = float("nan")
    difference: float = float("nan")


@dataclass(frozen=True)
class Peers:
    """All programs on all structures that they can solve."""

    rows: tuple[PeerRow, ...]

    def table(self) -> Table:
        """Lay the rows out."""
        rows = [
            (
                f"{row.program}, {row.structure}: {row.outcome}",
                _number(row.seconds, 3),
                _number(row.our_seconds, 3),
                _number(row.tip, 7),
                _number(row.our_tip, 7),
                _number(row.difference, 2),
            )
            for row in self.rows
        ]
        header = ("Program and structure", "Time [s]", "Ours [s]", "Tip", "Our tip", "Difference")
        note = (
            "Time: of a processor. Ours is one whole solve_path with its certificate, kernels compiled, not "
            "a run of a batch. Tip: the largest displacement. Difference: the largest of all coordinates, as "
            "a share of the structure's size."
        )
        return Table.of("Other programs", header, rows, "lrrrrr", note)


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if np.isfinite(value) else "–"


@dataclass(frozen=True, eq=False)
class Task:
    """A structure and an actuation that every program can be asked for.

    Attributes
    ----------
    arrays, path
        The structure flattened, and our solution.
    start
        Equilibrium before the actuation, ``(n_nodes, 3)``.
    """

    arrays: StructureArrays
    path: EquilibriumPath
    start: FloatArray

    @classmethod
    def of(cls, structure: Structure, actuation: Mapping[str, float]) -> "Task":
        """Solve the structure, to compare with."""
        path = solve_path(structure, actuation)
        return cls(structure_arrays(structure), path, path.stages[-1].nodes)

    @property
    def axial(self) -> FloatArray:
        """EA over the rest length, ``(n_members,)``."""
        rate: FloatArray = self.path.load.stiffness / self.path.load.rest_length
        return rate


def measure_peers(*, tell: Callable[[int], object] = lambda _done: None) -> Peers:
    """Ask every program for every structure that it can solve."""
    cases: list[tuple[str, str, Structure, Mapping[str, float], Callable[[Task], tuple[FloatArray, str]]]] = [
        ("MuJoCo", "mujoco", library.prism(3, clustered=True), {"top": 0.05}, _by_mujoco),
        ("MuJoCo", "mujoco", library.paper_beam(), {"A14": 0.10, "A23": 0.10}, _by_mujoco),
        ("musclepy", "musclepy", library.prism(3), {"top": 0.05}, _by_musclepy),
    ]
    rows = []
    for done, (name, package, structure, actuation, solve) in enumerate(cases):
        described = f"{structure.name}, " + ", ".join(f"{k} {v:.0%}" for k, v in actuation.items())
        if importlib.util.find_spec(package) is None:
            rows.append(PeerRow(name, described, f"not installed (pip install {package})"))
        else:
            importlib.import_module(package)  # its time is not that of a solution
            with one_blas_thread():
                rows.append(_row(f"{name} {version(package)}", described, structure, actuation, solve))
        tell(done + 1)
    return Peers(tuple(rows))


def _row(
    program: str,
    described: str,
    structure: Structure,
    actuation: Mapping[str, float],
    solve: Callable[[Task], tuple[FloatArray, str]],
) -> PeerRow:
    task = Task.of(structure, actuation)
    ours = []
    for _ in range(5):
        watch = Stopwatch()
        solve_path(structure, actuation)
        ours.append(watch.cpu)
    watch = Stopwatch()
    nodes, outcome = solve(task)
    seconds = watch.cpu
    moved = task.path.final.nodes - task.start
    at = np.unravel_index(np.argmax(np.abs(moved)), moved.shape)
    return PeerRow(
        program,
        described,
        outcome,
        seconds,
        float(np.median(ours)),
        float((nodes - task.start)[at]),
        float(moved[at]),
        float(np.abs(nodes - task.path.final.nodes).max() / task.arrays.size),
    )


def _by_mujoco(task: Task) -> tuple[FloatArray, str]:
    """Relax point masses on slides, held by spatial tendons: motion is stopped where it is fastest.

    Kinetic damping: M. R. Barnes, "Form finding and analysis of tension structures by dynamic
    relaxation", International Journal of Space Structures 14 (1999) 89–104.
    """
    mujoco: Any = importlib.import_module("mujoco")
    model = mujoco.MjModel.from_xml_string(_mujoco_model(task))
    data = mujoco.MjData(model)
    free = task.arrays.free
    data.qfrc_applied[:] = task.path.load.force[free]
    mass = np.repeat(model.body_mass[1:], free.sum(axis=1))
    accepted = RELAXED * float(np.abs(task.path.final.tensions).max())
    fastest, step = 0.0, 0
    for step in range(1, MOST_STEPS + 1):
        mujoco.mj_step(model, data)
        energy = float(np.dot(mass, data.qvel**2))
        if energy < fastest:
            data.qvel[:] = 0.0
            energy = 0.0
        fastest = energy
        if step % 16 == 0 and np.abs(mass * data.qacc).max() <= accepted:
            break
    nodes = task.start.copy()
    nodes[free] += data.qpos
    left = float(np.abs(mass * data.qacc).max() / np.abs(task.path.final.tensions).max())
    return nodes, f"{step:,} steps to a residual of {left:.0e}"


def _mujoco_model(task: Task) -> str:
    """Write the model: one time unit a step, masses for which that is stable."""
    arrays = task.arrays
    bodies = []
    for node, (position, mass) in enumerate(zip(task.start, _masses(task), strict=True)):
        slides = "".join(
            f'<joint type="slide" axis="{axis}"/>'
            for axis, moves in zip(("1 0 0", "0 1 0", "0 0 1"), arrays.free[node], strict=True)
            if moves
        )
        where = " ".join(repr(float(value)) for value in position)
        inertia = f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="{mass!r} {mass!r} {mass!r}"/>'
        bodies.append(f'<body pos="{where}">{inertia}{slides}<site name="{node}"/></body>')
    tendons = []
    for e, is_cable in enumerate(arrays.is_cable):
        segments = arrays.segment_nodes[arrays.segment_start[e] : arrays.segment_start[e + 1]]
        sites = "".join(f'<site site="{node}"/>' for node in [segments[0, 0], *segments[:, 1]])
        rest_length = float(task.path.load.rest_length[e])
        spring = f"{0.0 if is_cable else rest_length!r} {rest_length!r}"
        tendons.append(
            f'<spatial stiffness="{float(task.axial[e])!r}" springlength="{spring}">{sites}</spatial>'
        )
    return (
        '<mujoco><compiler boundmass="0" boundinertia="0"/>'
        '<option timestep="1" gravity="0 0 0" integrator="Euler"><flag contact="disable"/></option>'
        f"<worldbody>{''.join(bodies)}</worldbody><tendon>{''.join(tendons)}</tendon></mujoco>"
    )


def _masses(task: Task) -> list[float]:
    """Bound the highest frequency to half a radian a step, by Gershgorin's sum over each node's rows of K.

    With less than a quarter of these masses the stops of kinetic damping feed energy in.
    """
    arrays = task.arrays
    rows = np.zeros(arrays.n_nodes)
    for e in range(arrays.n_members):
        segments = arrays.segment_nodes[arrays.segment_start[e] : arrays.segment_start[e + 1]]
        pulls = np.bincount(segments.ravel(), minlength=arrays.n_nodes).astype(float)
        rows += task.axial[e] * pulls * pulls.sum()
    masses: list[float] = (4.0 * rows).tolist()
    return masses


def _by_musclepy(task: Task) -> tuple[FloatArray, str]:
    """Relax by musclepy's dynamic relaxation: m, N, areas of 1 mm² and moduli of EA in MPa."""
    musclepy: Any = importlib.import_module("musclepy")
    arrays, load = task.arrays, task.path.load
    nodes = musclepy.PyNodes(initial_coordinates=task.start, dof=arrays.free)
    moduli = np.stack([np.where(arrays.is_cable, 0.0, load.stiffness), load.stiffness], axis=1)
    elements = musclepy.PyElements(
        nodes,
        type=np.where(arrays.is_cable, 1, -1),
        end_nodes=arrays.segment_nodes,
        area=np.ones(arrays.n_members),
        youngs=moduli,
        free_length=load.rest_length.copy(),
    )
    largest = float(np.abs(task.path.final.tensions).max())
    settings = musclepy.PyConfigDR(
        max_time_step=MOST_STEPS, max_ke_reset=MOST_STEPS, zero_residual_atol=RELAXED * largest
    )
    truss = musclepy.PyTruss(nodes, elements)
    relaxed = musclepy.main_dynamic_relaxation(truss, loads_increment=load.force, config=settings)
    left = float(np.abs(relaxed.nodes.residuals).max() / largest)
    found: FloatArray = np.asarray(relaxed.nodes.coordinates)
    return found, f"{settings.n_time_step:,} steps to a residual of {left:.0e}"
