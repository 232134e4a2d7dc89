"""What is written of a structure: its members as they are now, and one frame for each position of it."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tensegra.errors import ModelError
from tensegra.mechanics import Batch, EquilibriumPath
from tensegra.mechanics.arrays import FloatArray, IndexArray, path_lengths, structure_arrays
from tensegra.mechanics.history import history_arrays
from tensegra.mechanics.law import plain as law
from tensegra.structure import Structure

__all__ = ["DRAWN", "Frame", "Scene", "scene_of"]

DRAWN = "drawn"
"""Status of a structure as it is drawn, which nobody has solved."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A structure at one position.

    Attributes
    ----------
    label
        Name of the stage, or of the run.
    time
        What a player of frames orders them by: the number of the stage plus the path parameter within
        it, or the number of the run.
    status
        What is known of the position, a word.
    nodes
        Positions, ``(n_nodes, 3)``, unit of length.
    tensions
        Tension positive, ``(n_members,)``, unit of force.
    """

    label: str
    time: float
    status: str
    nodes: FloatArray
    tensions: FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """A structure with its frames, the last one of which it is written at where a format takes one.

    Attributes
    ----------
    structure
        What it is.
    frames
        Its positions, at least one.
    rest_length, stiffness
        Effective rest lengths and EA at the last frame, ``(n_members,)``; None where they differ
        between frames that are runs.
    forces
        Nodal forces at the last frame, weight included, ``(n_nodes, 3)``.
    lowest_eigenvalue
        Of the tangent stiffness at the last frame, force per length; NaN where unknown.
    """

    structure: Structure
    frames: tuple[Frame, ...]
    rest_length: FloatArray | None
    stiffness: FloatArray | None
    forces: FloatArray
    lowest_eigenvalue: float = float("nan")

    @property
    def last(self) -> Frame:
        """The frame that a format of one position holds."""
        return self.frames[-1]

    @property
    def members(self) -> tuple[FloatArray, FloatArray]:
        """Rest lengths and EA of the members, for a format that holds one structure."""
        assert self.rest_length is not None  # noqa: S101 — many runs have formats of their own
        assert self.stiffness is not None  # noqa: S101 — idem
        return self.rest_length, self.stiffness

    def segments(self) -> tuple[IndexArray, IndexArray]:
        """Return the nodes at the ends of all segments, ``(n_segments, 2)``, and the member of each."""
        index = {node: n for n, node in enumerate(self.structure.node_ids)}
        pairs, owners = [], []
        for e, member in enumerate(self.structure.members.values()):
            for start, end in pairwise(member.nodes):
                pairs.append((index[start], index[end]))
                owners.append(e)
        return np.array(pairs, dtype=np.int64), np.array(owners, dtype=np.int64)


def scene_of(what: Structure | EquilibriumPath | Batch) -> Scene:
    """Return what is to be written of a structure as drawn, of all steps of a path, or of many runs.

    Raises
    ------
    ModelError
        No position of it is known: the first stage failed, or no run has one.
    """
    if isinstance(what, Structure):
        return _of_structure(what)
    return _of_path(what) if isinstance(what, EquilibriumPath) else _of_batch(what)


def _of_structure(structure: Structure) -> Scene:
    arrays = structure_arrays(structure)
    lengths = path_lengths(arrays, arrays.coordinates)
    tensions = law.tension(lengths, arrays.rest_length, arrays.stiffness)
    tensions = np.where(arrays.is_cable, np.maximum(tensions, 0.0), tensions)
    frame = Frame("drawing", 0.0, DRAWN, structure.coordinates, tensions)
    forces = arrays.nodal_weight[:, None] * np.array(structure.gravity)
    return Scene(structure, (frame,), arrays.rest_length, arrays.stiffness, forces)


def _of_path(path: EquilibriumPath) -> Scene:
    nodes, tensions = history_arrays(path.structure, path.history)
    stages: dict[str, int] = {}
    frames = [
        Frame(
            point.stage,
            stages.setdefault(point.stage, len(stages)) + point.parameter,
            "on the way",
            nodes[i],
            tensions[i],
        )
        for i, point in enumerate(path.history)
        # A later stage begins where the one before it ended.
        if i == 0 or point.parameter > 0.0
    ]
    final = path.final
    if np.isfinite(final.nodes).all():
        time = stages.setdefault(final.stage, len(stages)) + final.parameter
        if frames and frames[-1].time == time:
            frames.pop()  # the same position, without its certificate
        frames.append(Frame(final.stage, time, str(path.status), final.nodes, final.tensions))
    load = path.load
    return Scene(
        path.structure,
        _some(frames, path.structure),
        np.array(load.rest_length),
        np.array(load.stiffness),
        np.array(final.forces),
        float(final.lowest_eigenvalue),
    )


def _of_batch(batch: Batch) -> Scene:
    frames = (
        Frame(f"run {r}", float(r), str(batch.status[r]), batch.nodes[r], batch.tensions[r])
        for r in range(batch.n_runs)
        if np.isfinite(batch.nodes[r]).all()
    )
    none = np.zeros((batch.structure.n_nodes, 3))
    return Scene(batch.structure, _some(frames, batch.structure), None, None, none)


def _some(frames: Iterable[Frame], structure: Structure) -> tuple[Frame, ...]:
    found = tuple(frames)
    if not found:
        raise ModelError(f"{structure.name}: found no position to write, for none was reached")
    return found
