"""A structure as a model of MuJoCo that relaxes to the equilibrium by itself.

Each free node is a point mass on one slide for each free axis, each member a spatial tendon with the
stiffness EA/l₀ of a spring: one of a strut pushes and pulls, one of a cable is slack below its rest length
(MuJoCo's ``springlength="0 l₀"``). Loads are actuators of a constant force. The masses are not the
structure's: they are chosen so that every mode is about as fast as the others and a step of `TIME_STEP` is
stable, which is what a static answer needs.
"""

from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np
from numpy.typing import NDArray

from tensegra.exchange.files import replacing
from tensegra.exchange.scene import Scene
from tensegra.mechanics.arrays import AXES, StructureArrays, structure_arrays

__all__ = ["STRUT_GROUP", "model_of", "write"]

TIME_STEP = 0.002
"""Of the simulation, seconds: MuJoCo's own, which its viewer plays in real time."""

MARGIN = 4.0
"""Masses over those at which half a radian passes in a step of the fastest mode: with less than a quarter of
it, stopping the motion at its fastest feeds energy in."""

SLOWEST = 1e-3
"""Frequency that is damped critically where no lowest eigenvalue is known, as a share of the highest one."""

STRUT_GROUP = 1
"""MuJoCo's group of the tendons that are struts; cables are in group 0."""

_COLOURS = {"strut": "0.1 0.1 0.1 1", "cable": "0.0 0.45 0.7 1", "clustered": "0.84 0.37 0.0 1"}


def write(scene: Scene, path: Path) -> None:
    """Write the model at the last frame, where it is in equilibrium if the frame is."""
    tree = ElementTree(model_of(scene))
    indent(tree, " ")
    with replacing(path) as draft:
        tree.write(draft, encoding="utf-8", xml_declaration=True)


def model_of(scene: Scene, start: NDArray[np.float64] | None = None) -> Element:
    """Return the model.

    Parameters
    ----------
    scene
        What to model: rest lengths, stiffnesses and loads at its last frame.
    start
        Positions to start from, ``(n_nodes, 3)``; those of the last frame if left out.
    """
    rest_length, stiffness = scene.members
    arrays = structure_arrays(scene.structure)
    axial = stiffness / rest_length
    masses = _masses(arrays, axial)
    nodes = scene.last.nodes if start is None else start
    model = Element("mujoco", model=scene.structure.name)
    SubElement(model, "compiler", boundmass="0", boundinertia="0")
    option = SubElement(model, "option", timestep=repr(TIME_STEP), gravity="0 0 0", integrator="Euler")
    SubElement(option, "flag", contact="disable")
    visual = SubElement(model, "visual")
    SubElement(visual, "headlight", ambient="0.5 0.5 0.5")
    world = SubElement(model, "worldbody")
    width = 0.004 * arrays.size
    damping = 2.0 * masses * _slowest(scene.lowest_eigenvalue, masses)
    for n, node in enumerate(arrays.node_ids):
        body = SubElement(world, "body", name=node, pos=_row(nodes[n]))
        mass = repr(float(masses[n]))
        SubElement(body, "inertial", pos="0 0 0", mass=mass, diaginertia=f"{mass} {mass} {mass}")
        for i in np.flatnonzero(arrays.free[n]):
            axis = _row(np.eye(3)[i])
            name = f"{node}.{AXES[i]}"
            SubElement(body, "joint", name=name, type="slide", axis=axis, damping=repr(float(damping[n])))
        SubElement(body, "site", name=node, size=repr(1.5 * width))
    _add_tendons(model, scene, axial, rest_length, width)
    _add_loads(model, scene, arrays)
    return model


def _add_tendons(
    model: Element, scene: Scene, axial: NDArray[np.float64], rest_length: NDArray[np.float64], width: float
) -> None:
    tendons = SubElement(model, "tendon")
    for e, (name, member) in enumerate(scene.structure.members.items()):
        length = repr(float(rest_length[e]))
        tendon = SubElement(
            tendons,
            "spatial",
            name=name,
            group=str(0 if member.is_cable else STRUT_GROUP),
            stiffness=repr(float(axial[e])),
            springlength=f"0 {length}" if member.is_cable else length,
            width=repr(width if not member.is_cable else 0.4 * width),
            rgba=_COLOURS["clustered" if member.is_clustered else member.kind],
        )
        for node in member.nodes:
            SubElement(tendon, "site", site=node)


def _add_loads(model: Element, scene: Scene, arrays: StructureArrays) -> None:
    loaded = np.argwhere((scene.forces != 0.0) & arrays.free)
    if len(loaded):
        actuators = SubElement(model, "actuator")
        for n, i in loaded:
            name = f"{arrays.node_ids[n]}.{AXES[i]}"
            force = repr(float(scene.forces[n, i]))
            load = SubElement(actuators, "general", name=f"load {name}", joint=name, gainprm="0")
            load.set("biastype", "affine")
            load.set("biasprm", f"{force} 0 0")


def _masses(arrays: StructureArrays, axial: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return masses that bound the highest frequency, by Gershgorin's sum over each node's rows of K."""
    rows = np.zeros(arrays.n_nodes)
    for e in range(arrays.n_members):
        segments = arrays.segment_nodes[arrays.segment_start[e] : arrays.segment_start[e + 1]]
        pulls = np.bincount(segments.ravel(), minlength=arrays.n_nodes).astype(float)
        rows += axial[e] * pulls * pulls.sum()
    masses: NDArray[np.float64] = MARGIN * rows * TIME_STEP**2
    return masses


def _slowest(eigenvalue: float, masses: NDArray[np.float64]) -> float:
    """Return the circular frequency that is damped critically: below all of them where a bound is known."""
    if eigenvalue > 0.0:
        return float(np.sqrt(eigenvalue / masses.max()))
    return float(SLOWEST / (MARGIN**0.5 * TIME_STEP))


def _row(values: NDArray[np.float64]) -> str:
    return " ".join(repr(float(value)) for value in values)
