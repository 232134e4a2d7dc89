"""Named arrays with dimensions and units: what .nc, .mat, .npz and .csv hold of paths and of many runs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tensegra.errors import ModelError
from tensegra.exchange.scene import Scene
from tensegra.mechanics import Batch
from tensegra.structure import Structure
from tensegra.study import Campaign

__all__ = ["Dataset", "Variable", "dataset_of_batch", "dataset_of_campaign", "dataset_of_scene"]

Array = np.ndarray[Any, np.dtype[Any]]

AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class Variable:
    """An array with the names of its dimensions and its unit, "" for a ratio, a count or a text."""

    dimensions: tuple[str, ...]
    values: Array
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Dataset:
    """Named arrays over shared dimensions.

    Attributes
    ----------
    variables
        The arrays, in the order of their columns.
    labels
        What the places along a dimension are called, for those that have names.
    attributes
        Texts that tell what it is.
    """

    variables: Mapping[str, Variable]
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    attributes: Mapping[str, str] = field(default_factory=dict)

    def columns(self) -> dict[str, Array]:
        """Return one array over the first dimension for each number in a row, such as ``x_b0``."""
        columns: dict[str, Array] = {}
        for name, variable in self.variables.items():
            match variable.dimensions[1:]:
                case ():
                    columns[name] = variable.values
                case ("node", "axis"):
                    for n, node in enumerate(self.labels["node"]):
                        columns |= {f"{axis}_{node}": variable.values[:, n, i] for i, axis in enumerate(AXES)}
                case (dimension,):
                    stem = name.removesuffix("s")
                    columns |= {
                        f"{stem}_{label}": variable.values[:, i]
                        for i, label in enumerate(self.labels[dimension])
                    }
                case others:
                    raise ModelError.at(name, others, "an array over nodes and axes, or over members")
        return columns


def _labels(structure: Structure) -> dict[str, tuple[str, ...]]:
    return {"node": structure.node_ids, "axis": AXES, "member": structure.member_ids}


def _attributes(structure: Structure) -> dict[str, str]:
    units = structure.units
    return {
        "structure": structure.name,
        "unit_of_length": units.length,
        "unit_of_force": units.force,
        "unit_of_temperature": units.temperature,
    }


def dataset_of_scene(scene: Scene) -> Dataset:
    """Return the frames of a structure or a path."""
    structure, units = scene.structure, scene.structure.units
    rest_length, stiffness = scene.members
    frames = scene.frames
    return Dataset(
        {
            "nodes": Variable(("frame", "node", "axis"), np.stack([f.nodes for f in frames]), units.length),
            "tensions": Variable(("frame", "member"), np.stack([f.tensions for f in frames]), units.force),
            "time": Variable(("frame",), np.array([f.time for f in frames])),
            "label": Variable(("frame",), np.array([f.label for f in frames])),
            "status": Variable(("frame",), np.array([f.status for f in frames])),
            "rest_length": Variable(("member",), rest_length, units.length),
            "stiffness": Variable(("member",), stiffness, units.force),
        },
        _labels(structure),
        _attributes(structure),
    )


def dataset_of_batch(batch: Batch) -> Dataset:
    """Return the inputs and the results of many runs; a run that failed has NaN."""
    structure, units = batch.structure, batch.structure.units
    variables: dict[str, Variable] = {}
    given: dict[str, tuple[Mapping[Any, Any], str]] = {
        "actuation": (batch.inputs.actuation, ""),
        "temperature": (batch.inputs.temperature, units.temperature),
        "load": (batch.inputs.loads, units.force),
        "position": (batch.inputs.positions, units.length),
        "youngs_modulus": (batch.variants.youngs_modulus, units.of("stress")),
        "area": (batch.variants.area, units.of("area")),
        "rest_length": (batch.variants.rest_length, units.length),
    }
    for quantity, (values, unit) in given.items():
        for name, value in values.items():
            label = "_".join(name) if isinstance(name, tuple) else name
            over_runs = np.broadcast_to(np.asarray(value, dtype=np.float64), (batch.n_runs,))
            variables[f"{quantity}_{label}"] = Variable(("run",), over_runs, unit)
    variables |= {
        "status": Variable(("run",), np.array([str(status) for status in batch.status])),
        "reason": Variable(("run",), np.array([str(reason) for reason in batch.reason])),
        "residual": Variable(("run",), batch.residual),
        "lowest_eigenvalue": Variable(("run",), batch.lowest_eigenvalue, units.of("force per length")),
        "steps": Variable(("run",), batch.steps),
        "iterations": Variable(("run",), batch.iterations),
        "nodes": Variable(("run", "node", "axis"), batch.nodes, units.length),
        "tensions": Variable(("run", "member"), batch.tensions, units.force),
    }
    return Dataset(variables, _labels(structure), _attributes(structure))


def dataset_of_campaign(campaign: Campaign) -> Dataset:
    """Return the rows of a campaign, `Campaign.frame`; a run that failed has NaN."""
    study = campaign.study
    frame = campaign.frame()
    units = {variable.name: variable.unit for variable in study.variables}
    units |= {output.name: output.unit for output in study.outputs}
    variables = {"point": Variable(("run",), frame.index.to_numpy())}
    for name in frame.columns:
        values = frame[name].to_numpy()
        if values.dtype.kind not in "fiub":
            values = np.array(["" if value is None else str(value) for value in values], dtype=np.str_)
        variables[str(name)] = Variable(("run",), values, units.get(str(name), ""))
    return Dataset(variables, {}, {"study": study.name, **_attributes(study.structure)})
