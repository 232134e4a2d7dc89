"""The gripper of the source: clustered beams around an axis, closed by their actuators together."""

from dataclasses import replace
from math import cos, pi, sin

from tensegra.errors import ModelError
from tensegra.structure.coerce import Vector
from tensegra.structure.library.beam import paper_beam
from tensegra.structure.library.stressed import require_count, require_positive
from tensegra.structure.parts import Actuator, Member, Stage
from tensegra.structure.structure import Structure

__all__ = ["gripper"]


def gripper(n_beams: int = 4, radius: float = 185.0, *, beam: Structure | None = None) -> Structure:
    """Return the gripper: clustered beams that stand on a circle and bend towards its axis.

    The beam's own axis x points along the gripper's axis z, and its z, the way it deflects, inwards.
    Beams are numbered from 1: node 18 of the first beam is ``b1_18``, its first clustered cable ``b1_K1``,
    and all its members form the group ``beam1``. Groups and actuators of the beam keep their names and
    act on all beams together. Contact between the beams is not modelled. There is no gravity, as in
    the source's optimisation; the members have their weight, so ``gripper().replace(gravity=(0, 0, -1))``
    stands in it.

    Parameters
    ----------
    n_beams
        At least two.
    radius
        Distance of the beams' axes from the gripper's axis, cm. The publication prints none; with
        185, the polygon of the fingertips (nodes 18 and 23 of `paper_beam`) has 2980 cm² where all four
        cables are actuated by 30 %, near the printed 2910 cm².
    beam
        That stands there, such as `paper_beam_slender`; `paper_beam` where left out. Each of its held nodes
        is held along all axes.

    Raises
    ------
    ModelError
        Fewer than two beams, a radius that is not positive, or a beam with a node that is held along some
        axes only.

    Notes
    -----
    The capture mechanism of four beams is that of Fig. 16 of the publication whose beam `paper_beam`
    reconstructs.

    Examples
    --------
    >>> gripper()
    Structure('gripper': 96 nodes, 48 struts, 128 cables, 16 clustered; 240 free dof; units cm, kN)
    >>> from tensegra.mechanics import solve_path
    >>> closing = solve_path(gripper(), {"A14": 0.10, "A23": 0.10})
    >>> closing.status, round(closing.displacement("x", nodes=["b1_18", "b1_23"]))
    (<Status.STABLE: 'stable'>, -49)
    """
    require_count("gripper", 2, n_beams=n_beams)
    require_positive("gripper", radius=radius)
    beam = beam or paper_beam()
    for node, axes in beam.supports.items():
        if set(axes) != set("xyz"):
            raise ModelError.at(f"gripper: support {node} of the beam", axes, "xyz, which a rotation keeps")
    beams = range(1, n_beams + 1)

    def on_all(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"b{k}_{name}" for k in beams for name in names)

    return Structure(
        name="gripper",
        description=f"{n_beams} beams on a circle of radius {radius:g} around the axis z. {beam.description}",
        units=beam.units,
        nodes={
            f"b{k}_{node}": _placed(position, 2.0 * pi * (k - 1) / n_beams, radius)
            for k in beams
            for node, position in beam.nodes.items()
        },
        materials=beam.materials,
        members={
            f"b{k}_{name}": _member_of(k, member) for k in beams for name, member in beam.members.items()
        },
        supports={f"b{k}_{node}": axes for k in beams for node, axes in beam.supports.items()},
        actuators={
            name: Actuator(on_all(actuator.members), actuator.effect)
            for name, actuator in beam.actuators.items()
        },
        stages=tuple(
            Stage(
                stage.name,
                rest_length_changes={
                    f"b{k}_{name}": change
                    for k in beams
                    for name, change in stage.rest_length_changes.items()
                },
            )
            for stage in beam.stages
        ),
    )


def _placed(position: Vector, angle: float, radius: float) -> Vector:
    """Rotate: x of the beam along the gripper's axis, y along the circle, z inwards."""
    x, y, z = position
    outwards = radius - z
    return (
        outwards * cos(angle) - y * sin(angle),
        outwards * sin(angle) + y * cos(angle),
        x,
    )


def _member_of(k: int, member: Member) -> Member:
    return replace(
        member,
        nodes=tuple(f"b{k}_{node}" for node in member.nodes),
        groups=(*member.groups, f"beam{k}"),
    )
