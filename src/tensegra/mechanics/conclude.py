"""What is known of runs where they end: their certificates, and the words that are made of them."""

from collections.abc import Sequence

import numpy as np

from tensegra.mechanics.arrays import BoolArray, FloatArray
from tensegra.mechanics.certify import PROVED
from tensegra.mechanics.derivatives import Direction
from tensegra.mechanics.ends import StageEnd
from tensegra.mechanics.kernels import ZERO_EIGENVALUE
from tensegra.mechanics.reactions import internal_forces
from tensegra.mechanics.state import N_VECTORS
from tensegra.mechanics.status import Status
from tensegra.mechanics.supervise import Supervisor

PINNED = 1e4
"""Residuals that a coordinate held for a rigid motion may carry: the others' come to it by long levers."""


def concluded(
    supervisor: Supervisor, modes: FloatArray | None = None, directions: Sequence[Direction] = ()
) -> StageEnd:
    """Certify every run where it stands, and return what is known of it.

    Parameters
    ----------
    supervisor
        Who has brought the runs there.
    modes
        Guess of the softest modes, ``(n, n_nodes, 3)``.
    directions
        What to differentiate by.
    """
    solver, outcome, account = supervisor.solver, supervisor.outcome, supervisor.account
    n_runs, arrays = supervisor.n_runs, supervisor.arrays
    begin = _begin(supervisor, modes) if solver.iterates(n_runs) else None
    certificate, by = solver.certify(supervisor.runs, outcome, begin, directions)
    handed = supervisor.is_handed
    # Where a fall has found K singular, shifted to either side of zero, its lowest eigenvalue is none.
    gone = account.has(Status.COLLAPSED)
    certificate.lowest_eigenvalue[gone] = 0.0
    unproved = ~(gone | account.has(Status.FAILED) | handed) & (certificate.proof != PROVED)
    for run in map(int, np.flatnonzero(unproved)):
        tangent = supervisor.gauge.measured(run, outcome.nodes[run], float(outcome.parameter[run]))
        certificate.lowest_eigenvalue[run] = tangent.lowest_eigenvalue()
    lowest = certificate.lowest_eigenvalue
    _judge(supervisor, lowest, ~handed)
    failed = account.has(Status.FAILED)
    # What is left of the prestress where it is lost is rounding, of which no sign and no size is told.
    flat = account.has(Status.COLLAPSED)[:, None] & (
        np.abs(outcome.tensions) <= supervisor.flat_below[:, None]
    )
    tensions = np.where(flat, 0.0, outcome.tensions)
    nodes = outcome.nodes.reshape(n_runs, arrays.n_nodes, 3)
    if account.record is not None and not failed[0] and not handed[0]:
        parameter = float(outcome.parameter[0])
        if not account.history:
            account.note_point(nodes[0], parameter, int(outcome.iterations[0]))
        cables = arrays.is_cable
        account.note_events(cables & (outcome.tensions[0] > 0.0), cables & (tensions[0] > 0.0), parameter)
        account.correct_last_point(nodes[0], outcome.tensions[0], parameter)
    nothing_at = np.where(failed, np.nan, 0.0)
    stands = account.has(Status.STABLE, Status.SNAPPED)[:, None, None]
    end = StageEnd(
        name=account.name,
        nodes=nodes + nothing_at[:, None, None],
        tensions=tensions + nothing_at[:, None],
        parameter=outcome.parameter,
        status=account.status,
        reason=account.reason,
        residual=outcome.residual + nothing_at,
        lowest_eigenvalue=lowest + nothing_at,
        n_negative=np.where(failed, 0, certificate.n_negative),
        strain_energy=certificate.strain_energy + nothing_at,
        steps=outcome.steps,
        iterations=outcome.iterations,
        nodes_by=np.where(stands, by.nodes_by, np.nan),
        tensions_by=np.where(stands, by.tensions_by, np.nan),
        critical_points=account.critical_points,
        slack_events=account.slack_events,
        history=account.history,
        last_load=supervisor.gauge.load(0, float(outcome.parameter[0])) if n_runs == 1 else None,
    )
    for run in map(int, np.flatnonzero(handed)):
        other = supervisor.handed_on.get(run) or supervisor.hand_on(run)
        end.put(run, concluded(other, None, [direction.of_run(run) for direction in directions]))
    return end


def _begin(supervisor: Supervisor, modes: FloatArray | None) -> FloatArray:
    """Return where the iterations for the lowest eigenvalue begin, ``(3, 3 n_blocks)``."""
    if modes is None or len(modes) < N_VECTORS:
        return supervisor.solver.any_modes
    block_node = supervisor.solver.pattern.block_node
    rows = np.where((block_node >= 0)[:, None], modes[:N_VECTORS, block_node], 0.0)
    return rows.reshape(N_VECTORS, -1)


def _judge(supervisor: Supervisor, lowest: FloatArray, here: BoolArray) -> None:
    """Make the words of what stands at the end: an eigenvalue, a residual, what held coordinates carry."""
    outcome, account = supervisor.outcome, supervisor.account
    zero = ZERO_EIGENVALUE * supervisor.gauge.stiffest(supervisor.n_runs)
    arrived = here & account.has(Status.STABLE, Status.SNAPPED)
    leans = arrived & _leans(supervisor) if len(supervisor.gauge.motions) else np.zeros_like(arrived)
    in_balance = outcome.residual <= supervisor.settings.residual
    for run in map(int, np.flatnonzero(arrived & ~((lowest > zero) & in_balance & ~leans))):
        if lowest[run] < -zero[run]:
            account.set(run, Status.UNSTABLE, f"ends where K has the negative eigenvalue {lowest[run]:.4g}")
        elif not lowest[run] > zero[run]:
            account.set(run, Status.COLLAPSED, "ends where K is singular")
        elif leans[run]:
            lie = "its nodes have come to lie where they do not tell its rigid motions from others"
            account.fail(run, lie)
        else:
            account.fail(run, f"its residual at the end is {outcome.residual[run]:.3g}")
    for run in map(int, np.flatnonzero(arrived)) if any(account.critical_points) else ():
        snaps = [str(point) for point in account.critical_points[run] if account.is_snap(point)]
        if account.status[run] is Status.SNAPPED and snaps:
            account.reason[run] = "; ".join(snaps)


def _leans(supervisor: Supervisor) -> BoolArray:
    """Which runs lean on the coordinates that are held for neutral motions: they are in no equilibrium.

    What the members of a body pull with is in balance by itself, so that no force comes of such a
    coordinate, unless the nodes lie on a line, where they tell one motion less.
    """
    outcome, n_runs = supervisor.outcome, supervisor.n_runs
    nodes = outcome.nodes.reshape(n_runs, -1, 3)
    loads = np.array([supervisor.gauge.load(r, float(outcome.parameter[r])).force for r in range(n_runs)])
    out = internal_forces(supervisor.arrays, nodes, outcome.tensions) - loads
    out = np.abs(np.where(supervisor.solver.grip.held, out, 0.0)).max(axis=(1, 2))
    scale = np.maximum(np.abs(outcome.tensions).max(axis=1), np.abs(loads).max(axis=(1, 2)))
    # The other coordinates leave their own residuals to these, by levers as long as the body.
    worst: BoolArray = out > PINNED * supervisor.settings.residual * scale
    return worst
