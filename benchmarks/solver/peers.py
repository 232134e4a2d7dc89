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
from xml.etree import ElementTree as ET

import numpy as np

from benchmarks.solver.timing import Stopwatch, one_blas_thread
from tensegra.exchange.mujoco_write import model_of
from tensegra.exchange.scene import scene_of
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
    written = ET.tostring(model_of(scene_of(task.path), task.start), encoding="unicode")
    model = mujoco.MjModel.from_xml_string(written)
    model.dof_damping[:] = 0.0  # in place of which the motion is stopped
    data = mujoco.MjData(model)
    free = task.arrays.free
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
