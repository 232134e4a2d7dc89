"""The kernels alone, on one pack of lanes that all stand at the same equilibrium."""

import time

import numpy as np

from benchmarks.solver.timing import one_blas_thread
from tensegra.mechanics import kernels, step
from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.inputs import effective_rest_length, nodal_forces
from tensegra.mechanics.lanes import WIDTH, load, store
from tensegra.mechanics.path import prepare
from tensegra.mechanics.state import Lanes, Topology, Workspace
from tensegra.structure import Structure

__all__ = ["PARTS", "Pack", "fused_rate", "kernel_seconds", "matrix_product_rate"]

COPY, MEASURE, FORCE, ASSEMBLE, FACTORISE, SOLVE, TICK, CORRECT, DIFFERENTIATE = range(9)

PARTS = {
    "measure": MEASURE,
    "internal force": FORCE,
    "assemble": ASSEMBLE,
    "factorise": FACTORISE,
    "solve": SOLVE,
    "tick (measure, assemble, factorise)": TICK,
    "correct": CORRECT,
    "differentiate twice": DIFFERENTIATE,
}
"""Parts of a tick by name."""


class Pack:
    """One pack of lanes at the equilibrium after the stages of a structure."""

    def __init__(self, structure: Structure) -> None:
        prepared = prepare(structure)
        ground, end = prepared.ground, prepared.ends[-1]
        arrays, force = ground.arrays, nodal_forces(ground.arrays, prepared.inputs)
        solver = ground.solver(ground.freedom(force), end.nodes[0])
        self.pattern, self.topology = solver.pattern, solver.topology
        self._shared = solver.shared  # what the addresses of the topology point to
        self.work = Workspace(solver.shared, 0)
        self.smallest_scale = step.LENGTH_ROUNDING / solver.control.tolerance
        rest_length = effective_rest_length(arrays, prepared.inputs)
        for field, values in (
            (self.work.x, end.nodes[0].reshape(-1)),
            (self.work.coefficients, rest_length),
            (self.work.stiffness, arrays.stiffness),
            (self.work.loads_start, force.reshape(-1)),
            (self.work.stress, end.tensions[0]),
            (self.work.scale, np.max(arrays.stiffness / rest_length)),
        ):
            field[:] = np.reshape(values, (-1, 1))

    @property
    def residual(self) -> float:
        """Relative residual that the kernels find at the equilibrium."""
        self.repeat(TICK, 1)
        return float(self.work.residual.max())

    def repeat(self, part: int, calls: int, saved: FloatArray | None = None) -> None:
        """Do a part of a tick over and over, on a copy of the blocks `saved` where it destroys them."""
        blocks = self.work.blocks.copy() if saved is None else saved
        _repeat(part, calls, self.topology, self.work.lanes, self.smallest_scale, blocks)


def kernel_seconds(pack: Pack, rounds: int, calls: int = 2000) -> dict[str, FloatArray]:
    """Return the time of each part for one lane, ``(rounds,)``; copies of workspace are taken off.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> times = kernel_seconds(Pack(library.prism()), rounds=1, calls=8)
    >>> sorted(times) == sorted(PARTS)
    True
    """
    pack.repeat(TICK, 1)
    pack.repeat(ASSEMBLE, 1)
    stiffness = pack.work.blocks.copy()
    times: dict[str, list[float]] = {name: [] for name in PARTS}
    for _ in range(rounds):
        copying = _seconds(pack, COPY, calls, stiffness)
        for name, part in PARTS.items():
            # Only the factorisation destroys what it reads; the others see a factor.
            if part != FACTORISE:
                pack.repeat(TICK, 1)
            took = _seconds(pack, part, calls, stiffness)
            times[name].append((took - copying if part == FACTORISE else took) / WIDTH)
    return {name: np.array(values) for name, values in times.items()}


def _seconds(pack: Pack, part: int, calls: int, saved: FloatArray) -> float:
    began = time.process_time()
    pack.repeat(part, calls, saved)
    return (time.process_time() - began) / calls


@njit
def _repeat(  # noqa: C901 - one branch a kernel
    part: int, calls: int, topology: Topology, lanes: Lanes, smallest_scale: float, saved: FloatArray
) -> None:
    for _ in range(calls):
        if part in (COPY, FACTORISE):
            for i in range(saved.shape[0]):
                store(lanes.blocks, i, load(saved, i))
        if part == MEASURE:
            kernels.measure(topology, lanes)
        elif part == FORCE:
            kernels.internal_force(topology, lanes, lanes.tension, lanes.force)
        elif part == ASSEMBLE:
            kernels.assemble(topology, lanes)
        elif part == FACTORISE:
            kernels.factorise(topology, lanes)
        elif part == SOLVE:
            kernels.solve(topology, lanes, lanes.second)
        elif part == TICK:
            # As the follower does it.
            step.prescribe(topology, lanes)
            step.taut_by_stress(topology, lanes)
            step.carried_by(topology, lanes)
            kernels.measure(topology, lanes)
            step.balance(topology, lanes, smallest_scale)
            step.factorise(topology, lanes)
        elif part == CORRECT:
            step.correct(topology, lanes)  # no lane is active: the pack stays where it is
        elif part == DIFFERENTIATE:
            step.differentiate(topology, lanes)


def matrix_product_rate(order: int = 192, calls: int = 20) -> float:
    """Return the multiply-adds a second of BLAS ``dgemm`` on one thread, matrices in the cache."""
    from scipy.linalg.blas import dgemm

    a = np.asfortranarray(np.random.default_rng(0).standard_normal((order, order)))
    c = np.zeros((order, order), order="F")
    with one_blas_thread():
        dgemm(1.0, a, a, c=c, overwrite_c=1)
        began = time.process_time()
        for _ in range(calls):
            dgemm(1.0, a, a, c=c, overwrite_c=1)
        took = time.process_time() - began
    return calls * float(order) ** 3 / took


def fused_rate(loops: int = 200_000) -> float:
    """Return the multiply-adds a second of a compiled loop over packs that stay in registers."""
    packs = np.full((N_CHAINS + 1, WIDTH), 1e-3)
    _fused(packs, 1)
    began = time.process_time()
    _fused(packs, loops)
    return float(loops) * N_CHAINS * WIDTH / (time.process_time() - began)


N_CHAINS = 10
"""Independent sums: enough to hide the latency of a multiply-add, few enough to stay in registers."""


@njit
def _fused(packs: FloatArray, loops: int) -> None:
    a = load(packs, 10)
    c0, c1, c2, c3, c4 = load(packs, 0), load(packs, 1), load(packs, 2), load(packs, 3), load(packs, 4)
    c5, c6, c7, c8, c9 = load(packs, 5), load(packs, 6), load(packs, 7), load(packs, 8), load(packs, 9)
    for _ in range(loops):
        c0, c1, c2, c3, c4 = c0 * a + a, c1 * a + a, c2 * a + a, c3 * a + a, c4 * a + a
        c5, c6, c7, c8, c9 = c5 * a + a, c6 * a + a, c7 * a + a, c8 * a + a, c9 * a + a
    for i, value in ((0, c0), (1, c1), (2, c2), (3, c3), (4, c4)):
        store(packs, i, value)
    for i, value in ((5, c5), (6, c6), (7, c7), (8, c8), (9, c9)):
        store(packs, i, value)
