"""From a batch of solved runs to training data for whole fields, and back to arrays of nodes and members."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.regimes import RegimeData, regime_labels

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from tensegra.mechanics import Batch
    from tensegra.mechanics.derivatives import ParameterKind
    from tensegra.surrogate.surrogate import Surrogate

__all__ = ["FieldArrays", "field_arrays", "field_runs"]

Array: TypeAlias = NDArray[np.float64]

AXES = "xyz"
_KINDS: "Mapping[str, ParameterKind]" = {
    "actuation": "actuation",
    "temperature": "temperature",
    "loads": "load",
    "positions": "position",
    "youngs_modulus": "youngs_modulus",
    "area": "area",
    "rest_length": "rest_length",
}


class FieldArrays(NamedTuple):
    """Positions (n_points, n_nodes, 3) and tensions (n_points, n_members)."""

    nodes: Array
    tensions: Array


def field_runs(batch: "Batch", *, bounds: ArrayLike | None = None, derivatives: bool = False) -> RegimeData:
    """Return all that a batch knows of its runs: every coordinate and tension, and the regimes.

    Parameters
    ----------
    batch
        Solved runs; what was varied becomes the inputs, in the order and by the names of `solve_batch`'s
        arguments. A load or position is called as ``Fx_18`` or ``x_18``.
    bounds
        The box of the inputs, shape (n_inputs, 2); their extremes where left out.
    derivatives
        Whether to differentiate all outputs by all inputs, exactly.

    Returns
    -------
    RegimeData
        The outputs are ``x_1, y_1, z_1, x_2, …`` (positions of the nodes) and ``T_K1, …`` (tensions of the
        members).

    Raises
    ------
    StudyError
        If nothing was varied, an input has no unique name, or no run stands.
    """
    inputs = list(_inputs(batch))
    if not inputs:
        raise StudyError("field: the batch varies nothing")
    X = np.column_stack([values for *_, values in inputs])
    Y = np.concatenate([batch.nodes.reshape(batch.n_runs, -1), batch.tensions], axis=1)
    data = RegimeData.of(
        X,
        Y,
        regime_labels(batch),
        **({} if bounds is None else {"bounds": np.asarray(bounds, dtype=np.float64)}),
        input_names=tuple(name for name, *_ in inputs),
        output_names=(
            *(f"{axis}_{node}" for node in batch.node_ids for axis in AXES),
            *(f"T_{member}" for member in batch.member_ids),
        ),
        output_units=(
            *[batch.structure.units.length] * (3 * len(batch.node_ids)),
            *[batch.structure.units.force] * len(batch.member_ids),
        ),
    )
    return _differentiated(data, batch, inputs) if derivatives else data


def field_arrays(surrogate: "Surrogate", Y: Array) -> FieldArrays:
    """Return the outputs of a surrogate of whole fields as positions and tensions.

    Parameters
    ----------
    surrogate
        Trained on `field_runs`.
    Y
        What it predicted, shape (n_points, n_outputs).

    Raises
    ------
    StudyError
        If it was trained on something else.
    """
    names = surrogate.output_names
    n_tensions = sum(name.startswith("T_") for name in names)
    n_coordinates = len(names) - n_tensions
    expected = [axis for _ in range(n_coordinates // 3) for axis in AXES]
    if n_coordinates % 3 or [name[0] for name in names[:n_coordinates]] != expected:
        raise StudyError.at("field: outputs", names[:3], "x_1, y_1, z_1, …, as field_runs names them")
    return FieldArrays(Y[:, :n_coordinates].reshape(len(Y), -1, 3), Y[:, n_coordinates:])


def _inputs(batch: "Batch") -> "Iterator[tuple[str, ParameterKind, Any, Array]]":
    """Yield for each input its name, its kind, the solver's name for it and its values."""
    seen: set[str] = set()
    for kind in _KINDS:
        group = getattr(batch.inputs if hasattr(batch.inputs, kind) else batch.variants, kind)
        for key, values in group.items():
            name = str(key)
            if isinstance(key, tuple):
                name = f"{'F' if kind == 'loads' else ''}{key[1]}_{key[0]}"
            if name in seen:
                name = f"{kind}_{name}"
            seen.add(name)
            yield name, _KINDS[kind], key, np.broadcast_to(values, batch.n_runs)


def _differentiated(
    data: RegimeData, batch: "Batch", inputs: "list[tuple[str, ParameterKind, Any, Array]]"
) -> RegimeData:
    """Return the data with derivatives of all outputs by all inputs."""
    dY = np.stack(
        [
            np.concatenate([by.nodes.reshape(batch.n_runs, -1), by.tensions], axis=1)
            for by in (batch.derivative(key, kind) for _, kind, key, _ in inputs)
        ],
        axis=2,
    )
    stands = np.isin(regime_labels(batch), data.regimes)
    return replace(data, runs=replace(data.runs, dY=dY[stands]))
