"""From a structure, a path or many runs to what the viewer draws: flat arrays in plain JSON values."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import ModelError
from tensegra.mechanics import Batch, Equilibrium, EquilibriumPath, Status
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.stability import LARGEST_SVD, self_stress, tangent_at
from tensegra.structure import Structure

__all__ = ["equilibrium_scene", "scene", "shapes_scene"]

FloatArray = NDArray[np.float64]
Json = dict[str, Any]

SCHEMA = "tensegra/scene/1"

MOST_MECHANISMS = 24
"""Mechanisms of a structure that are offered to be looked at; more can hardly be told apart."""

MOST_FRAMES = 400
"""Frames of a path or runs of a batch in one scene: more do not make a smoother picture."""


@singledispatch
def scene(shown: object, **_: object) -> Json:
    """Return what the viewer draws of a structure, a path or many runs.

    Parameters
    ----------
    shown
        A `Structure` as it is given, with its mechanisms; an `EquilibriumPath` with a frame for each
        accepted step (``modes``: how many of the softest modes at its end, 6); or a `Batch` with a
        frame for each run that has an equilibrium (``labels``: a name for each run).

    Returns
    -------
    dict
        Plain JSON values in the structure's units; arrays in base64, little-endian, four bytes a number.

    Raises
    ------
    ModelError
        For anything else.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> drawn = scene(library.paper_beam())
    >>> len(drawn["nodes"]), drawn["positions"]["shape"]
    (24, [1, 24, 3])
    """
    raise ModelError.at("view", type(shown).__name__, "a structure, a path or a batch of runs")


@scene.register
def _(shown: Structure) -> Json:
    arrays = structure_arrays(shown)
    modes: list[Json] = []
    if arrays.n_free <= LARGEST_SVD // 4:
        mechanisms = self_stress(shown).mechanisms[:MOST_MECHANISMS]
        modes = [_mode(f"mechanism {i}", shape) for i, shape in enumerate(mechanisms, 1)]
    return _topology(shown) | {
        "reference": None,
        "positions": _packed(shown.coordinates[None]),
        "tensions": None,
        "forces": None,
        "labels": ["as given"],
        "statuses": [],
        "modes": modes,
    }


@scene.register
def _(shown: EquilibriumPath, modes: int = 6) -> Json:
    """Draw every accepted step; of a path without a history, the ends of its stages."""
    structure = shown.structure
    ends = [end for end in (*shown.stages, shown.actuation) if end is not None and _stands(end)]
    if not ends:
        return scene(structure) | {"statuses": [str(shown.status)]}
    forces = _forces_at(shown)
    points = shown.history or ()
    if points:
        chosen = _spread(len(points))
        frames = [points[i] for i in chosen]
        labels = [f"{point.stage}, {100 * point.parameter:.1f} %" for point in frames]
        statuses = [""] * (len(frames) - 1) + [str(shown.status)]
        nodes, tensions = [p.nodes for p in frames], [p.tensions for p in frames]
        forces_shown = [forces(p.stage, p.parameter) for p in frames]
    else:
        labels, statuses = [end.stage for end in ends], [str(end.status) for end in ends]
        nodes, tensions = [end.nodes for end in ends], [end.tensions for end in ends]
        forces_shown = [end.forces for end in ends]
    reference = shown.stages[-1].nodes if _stands(shown.stages[-1]) else structure.coordinates
    return _topology(structure) | {
        "reference": _packed(reference),
        "positions": _packed(nodes),
        "tensions": _packed(tensions),
        "forces": _packed(forces_shown),
        "labels": labels,
        "statuses": statuses,
        "modes": _softest(shown, modes),
    }


@scene.register
def _(shown: Batch, labels: Sequence[str] | None = None) -> Json:
    structure = shown.structure
    runs = np.flatnonzero(np.isfinite(shown.nodes).all(axis=(1, 2)))
    if not len(runs):
        return scene(structure) | {"statuses": ["no run has an equilibrium"]}
    runs = runs[_spread(len(runs))]
    return _topology(structure) | {
        "reference": _packed(shown.start[0]),
        "positions": _packed(shown.nodes[runs]),
        "tensions": _packed(shown.tensions[runs]),
        "forces": None,
        "labels": [f"run {run}" if labels is None else labels[int(run)] for run in runs],
        "statuses": [str(status) for status in shown.status[runs]],
        "modes": [],
    }


def equilibrium_scene(found: Equilibrium, reference: ArrayLike) -> Json:
    """Return what the viewer draws of one equilibrium, beside where it is measured from.

    Parameters
    ----------
    found
        An equilibrium that did not fail.
    reference
        Positions that are drawn as a ghost, ``(n_nodes, 3)``.
    """
    return _topology(found.structure) | {
        "reference": _packed(reference),
        "positions": _packed(found.nodes[None]),
        "tensions": _packed(found.tensions[None]),
        "forces": _packed(found.forces[None]),
        "labels": [found.stage],
        "statuses": [str(found.status)],
        "modes": [],
    }


def shapes_scene(structure: Structure, reference: FloatArray, shapes: Mapping[str, FloatArray]) -> Json:
    """Return what the viewer draws of some shapes of a structure of which the tensions are not told.

    Parameters
    ----------
    structure
        The structure.
    reference
        Positions of the first frame and of the ghost, ``(n_nodes, 3)``.
    shapes
        Positions by title, a frame each.
    """
    return _topology(structure) | {
        "reference": _packed(reference),
        "positions": _packed([reference, *shapes.values()]),
        "tensions": None,
        "forces": None,
        "labels": ["reference", *shapes],
        "statuses": [],
        "modes": [],
    }


def _topology(structure: Structure) -> Json:
    """Return names, members and limits: what holds still from frame to frame."""
    arrays = structure_arrays(structure)
    member_of = np.repeat(np.arange(arrays.n_members), arrays.n_segments)
    tension, compression = _limits(structure)
    return {
        "schema": SCHEMA,
        "name": structure.name,
        "units": {"length": structure.units.length, "force": structure.units.force},
        "nodes": list(structure.node_ids),
        "members": list(structure.member_ids),
        "kinds": ["clustered" if m.is_clustered else m.kind for m in structure.members.values()],
        "stiffness": _packed(arrays.stiffness),
        "thickness": _packed(_thickness(structure, arrays.stiffness)),
        "tension_limit": _packed(tension),
        "compression_limit": _packed(compression),
        "segments": _packed(np.column_stack([arrays.segment_nodes, member_of]).astype(np.int32)),
        "supports": [[node, axes] for node, axes in structure.supports.items()],
    }


def _limits(structure: Structure) -> tuple[FloatArray, FloatArray]:
    """Return the forces that members may carry either way, infinite where nothing is said of it.

    A strut's Euler load π² E I/l₀² is that of `Equilibrium.utilisation`, hinged at both ends.
    """
    tension = np.full(structure.n_members, np.inf)
    compression = np.full(structure.n_members, np.inf)
    for e, member in enumerate(structure.members.values()):
        if member.strength is not None:
            tension[e] = member.strength
        if member.section_inertia is not None and member.material is not None:
            modulus = structure.materials[member.material].youngs_modulus
            compression[e] = np.pi**2 * modulus * member.section_inertia / member.rest_length**2
    return tension, compression


def _thickness(structure: Structure, stiffness: FloatArray) -> FloatArray:
    """Return the diameter of each member beside the thickest of its kind, in (0, 1].

    By the area, where every member has one; by EA otherwise, which is as good within a material.
    """
    areas = [member.area for member in structure.members.values()]
    sizes = stiffness if None in areas else np.array(areas, dtype=np.float64)
    is_strut = np.array([not member.is_cable for member in structure.members.values()])
    shares = np.ones(structure.n_members)
    for kind in (is_strut, ~is_strut):
        if kind.any():
            shares[kind] = np.sqrt(sizes[kind] / sizes[kind].max())
    return np.clip(shares, 0.3, 1.0)


def _forces_at(path: EquilibriumPath) -> Any:  # noqa: ANN401 - a function of stage and parameter
    """Return the nodal forces by stage and parameter: they grow in proportion within a stage."""
    before = np.zeros((path.structure.n_nodes, 3))
    ways = {}
    for end in (*path.stages, path.actuation):
        if end is None or not np.all(np.isfinite(end.forces)):
            continue
        ways[end.stage] = before, end.forces, end.parameter
        before = end.forces

    def at(stage: str, parameter: float) -> FloatArray:
        if stage not in ways:
            return np.zeros_like(before)
        start, there, reached = ways[stage]
        share = parameter / reached if reached > 0.0 else 1.0
        forces: FloatArray = start + share * (there - start)
        return forces

    return at


def _softest(path: EquilibriumPath, n_modes: int) -> list[Json]:
    """Return the softest modes of K where a path ends, named by their stiffness."""
    if n_modes < 1 or path.final.status is Status.FAILED:
        return []
    spectrum = tangent_at(path).spectrum(n_modes)
    units = path.structure.units
    return [
        _mode(f"mode {i}: {value:.4g} {units.force}/{units.length}", vector)
        for i, (value, vector) in enumerate(zip(spectrum.values, spectrum.vectors, strict=True), 1)
    ]


def _mode(name: str, shape: FloatArray) -> Json:
    """Return a mode whose largest displacement of a node is one."""
    most = float(np.linalg.norm(shape, axis=1).max(initial=0.0))
    return {"name": name, "shape": _packed(shape / most if most > 0.0 else shape)}


def _stands(end: Equilibrium) -> bool:
    """Tell whether an end has a position that can be drawn."""
    return bool(np.all(np.isfinite(end.nodes)))


def _spread(n: int) -> NDArray[np.int64]:
    """Return the places of at most `MOST_FRAMES` of n frames, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, MOST_FRAMES)).round().astype(np.int64))


def _packed(values: ArrayLike | Sequence[FloatArray]) -> Json:
    """Return an array as base64: whole numbers as int32, others as float32."""
    array = np.asarray(values)
    kind = "i4" if array.dtype.kind == "i" else "f4"
    data = np.ascontiguousarray(array, dtype=f"<{kind}").tobytes()
    return {"type": kind, "shape": list(array.shape), "data": b64encode(data).decode()}
