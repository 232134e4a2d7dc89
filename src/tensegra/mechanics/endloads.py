"""What acts on many runs where they ended: the loads beside which their reactions stand."""

from tensegra.mechanics.arrays import FloatArray, structure_arrays
from tensegra.mechanics.derivatives import Given, ParameterKind, direction_of
from tensegra.mechanics.inputs import Actuation, actuation_inputs, initial_inputs, stage_inputs
from tensegra.mechanics.path import stage_targets
from tensegra.mechanics.variants import Variants, varied_arrays
from tensegra.structure import Structure

__all__ = ["end_load_rates", "end_loads"]


def end_loads(
    structure: Structure, inputs: Actuation, variants: Variants, parameter: FloatArray
) -> FloatArray:
    """Return the nodal forces where runs ended, weight included, shape ``(n_runs, n_nodes, 3)``.

    Parameters
    ----------
    structure, inputs, variants
        The runs.
    parameter
        Path parameter in [0, 1] at which each of them ended, within the actuation or, where nothing
        acts after the stages, within the last of these, shape ``(n_runs,)``.
    """
    arrays = varied_arrays(structure, structure_arrays(structure), variants)
    targets = [initial_inputs(arrays), *(after for _, after in stage_targets(structure, arrays))]
    if inputs.acts:
        way, _ = actuation_inputs(structure, arrays, targets[-1], inputs)
    else:
        way = stage_inputs(arrays, targets[-2], targets[-1])
    loads: FloatArray = way.loads_start + parameter[:, None, None] * (way.loads_end - way.loads_start)
    return loads


def end_load_rates(structure: Structure, kind: ParameterKind, name: object) -> FloatArray:
    """Return the rates of the nodal forces with one parameter, shape ``(n_nodes, 3)``.

    They are the same for all runs of a structure: loads and weights are linear in all that sets them.

    Parameters
    ----------
    structure
        The structure.
    kind, name
        The parameter, as in `direction_of`.
    """
    arrays = structure_arrays(structure)
    last = stage_targets(structure, arrays)[-1][1]
    return direction_of(Given(structure, arrays, last, Actuation({}, {}, {}, {})), kind, name).force
