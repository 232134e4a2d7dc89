"""A beam of the family: layout, shape, prestress and properties, as a structure that tensegra solves."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import tensegra as tg
from tensegra_paper.identification.layout import N_SECTIONS, N_SIDES, Layout, node_id, reconstruction
from tensegra_paper.identification.shape import N_KINDS, N_STAGES, Shape, free_directions, shape_of

__all__ = ["AREAS", "HELD", "N_NUMBERS", "N_SHAPE", "Candidate", "content", "reference"]

Array: TypeAlias = NDArray[np.float64]

CABLE_AREA, STEEL, ALUMINIUM = 0.5026, 11500.0, 7000.0
"""As printed in Table 1: cm², kN/cm²."""

PRESTRESS = -0.0255
"""Relative change of rest length of the two top clustered cables, as printed."""

AREAS = (255.0, 2.55)
"""Of a strut: as printed, and what the printed value may be a misprint of; cm²."""

HELD = ("section", "stage", "plane")
"""What is held: all nodes of the first section; of the first two sections; or the first section along the
beam's axis with two of its nodes held across."""

N_SHAPE = 3 * N_SECTIONS + N_KINDS

SIDE_MODES = np.array([[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, -1.0, 1.0], [1.0, -1.0, 1.0, -1.0]])
"""How rest lengths may differ from side to side: top against bottom, flank against flank, alternating."""

FAMILIES = ("struts", "squares", "ties", "clustered")

SIDE_UNIT = 0.05
"""Relative difference of a rest length that counts as much as a factor e of a radius or of a force."""

N_NUMBERS = N_SHAPE + 2 + len(FAMILIES) * len(SIDE_MODES)
"""Numbers of a candidate: of its shape, base self-stress, thermal expansion, differences between sides."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A beam of the family.

    Attributes
    ----------
    layout
        How its members run.
    numbers
        `Shape.to_vector` of the wanted shape; then logarithms of the clustered cables' tension as drawn, kN,
        and of the thermal expansion of the classical cables, 1/K; then by how much rest lengths of `FAMILIES`
        differ from side to side, by `SIDE_MODES`, in `SIDE_UNIT`. Shape (44,).
    area
        Of a strut, cm², one of `AREAS`.
    held
        One of `HELD`.
    """

    layout: Layout
    numbers: Array
    area: float = AREAS[0]
    held: str = HELD[0]
    _kept: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def shape(self) -> Shape | None:
        """The balanced shape nearest to the wanted one, or None."""
        if "shape" not in self._kept:
            self._kept["shape"] = shape_of(self.layout, self.numbers[:N_SHAPE])
        found: Shape | None = self._kept["shape"]
        return found

    @property
    def self_stress(self) -> float:
        """Tension of the clustered cables as drawn, kN."""
        return float(np.exp(self.numbers[N_SHAPE]))

    @property
    def expansion(self) -> float:
        """Thermal expansion of the classical cables, 1/K."""
        return float(np.exp(self.numbers[N_SHAPE + 1]))

    @property
    def directions(self) -> Array:
        """Ways to move: an orthonormal basis, rows of 44 numbers; none where the shape does not balance."""
        if self.shape is None:
            return np.zeros((0, len(self.numbers)))
        free = free_directions(self.layout, self.shape.to_vector())
        others = np.eye(len(self.numbers))[N_SHAPE:]
        return np.vstack([np.pad(free, ((0, 0), (0, len(others)))), others])

    def balanced(self) -> "Candidate":
        """Return the candidate with the numbers of its balanced shape."""
        if self.shape is None:
            return self
        return self.moved(np.concatenate([self.shape.to_vector(), self.numbers[N_SHAPE:]]))

    @property
    def side_factors(self) -> dict[str, Array]:
        """Factor of the rest lengths by family and side, shape (4,) each."""
        modes = self.numbers[N_SHAPE + 2 :].reshape(len(FAMILIES), -1)
        factors = np.exp(SIDE_UNIT * modes @ SIDE_MODES)
        return dict(zip(FAMILIES, factors, strict=True))

    def moved(self, numbers: Array) -> "Candidate":
        """Return the candidate with other numbers."""
        return replace(self, numbers=numbers)

    def structure(self, name: str = "candidate", description: str = "") -> tg.Structure | None:
        """Return the structure, or None where its shape does not balance.

        Parameters
        ----------
        name, description
            Of the structure.
        """
        shape = self.shape
        return None if shape is None else tg.parse_structure(content(self, shape, name, description))

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "shifts": list(self.layout.shifts),
            "ties": [list(tie) for tie in self.layout.ties],
            "route": list(self.layout.route),
            "numbers": self.numbers.tolist(),
            "area": self.area,
            "held": self.held,
        }

    @classmethod
    def of_dict(cls, kept: dict[str, Any]) -> "Candidate":
        """Build it from `to_dict`."""
        first, second, third = kept["shifts"]
        ties = tuple((int(s), int(t), int(m)) for s, t, m in kept["ties"])
        layout = Layout((first, second, third), ties, tuple(kept["route"]))
        return cls(layout, np.array(kept["numbers"]), kept["area"], kept["held"])


def content(candidate: Candidate, shape: Shape, name: str, description: str = "") -> dict[str, Any]:
    """Return a beam as the content of a structure file.

    Parameters
    ----------
    candidate
        Layout, self-stress and properties.
    shape
        That balances.
    name, description
        Of the structure.
    """
    places = _places(shape)
    nodes = {node_id(s, k): places[s][k].round(6).tolist() for s in range(N_SECTIONS) for k in range(N_SIDES)}
    nodes = dict(sorted(nodes.items(), key=lambda item: int(item[0])))
    supports = _supports(candidate.held)
    fixed = {node for node, axes in supports.items() if axes == "xyz"}
    members = _classical(candidate, shape, fixed) | _clustered(candidate, shape)
    return {
        "schema": "tensegra/structure/1",
        "name": name,
        **({"description": description} if description else {}),
        "units": {"length": "cm", "force": "kN", "temperature": "degC"},
        "nodes": nodes,
        "materials": {
            "aluminium": {"youngs_modulus": ALUMINIUM, "weight": 2.7e-05},
            "steel": {"youngs_modulus": STEEL, "weight": 7.85e-05, "thermal_expansion": candidate.expansion},
            "steel_rope": {"youngs_modulus": STEEL, "weight": 7.85e-05},
        },
        "members": members,
        "supports": supports,
        "gravity": [0, 0, -1],
        "actuators": {
            name: {"members": cables, "effect": "shorten" if name in {"A14", "A1", "A4"} else "lengthen"}
            for name, cables in _ACTUATORS.items()
        },
        "stages": [{"name": "prestress", "rest_length_changes": {"K1": PRESTRESS, "K4": PRESTRESS}}],
    }


def _places(shape: Shape) -> list[Array]:
    """Return the positions of the nodes by section, shape (4, 3) each."""
    sides = np.arange(N_SIDES, dtype=np.float64)
    return [shape.positions(section, sides) for section in range(N_SECTIONS)]


def _classical(candidate: Candidate, shape: Shape, fixed: set[str]) -> dict[str, Any]:
    """Return struts and classical cables as a structure file has them."""
    places, factors = _places(shape), candidate.side_factors
    tension = shape.force / shape.force[-1] * candidate.self_stress
    members: dict[str, Any] = {}
    count = {"s": 0, "c": 0}
    for kind, s, t, shift in candidate.layout.segments():
        if kind == N_KINDS - 1:
            break
        strut = kind < N_STAGES
        family = "struts" if strut else "squares" if s == t else "ties"
        letter, sign = ("s", -1.0) if strut else ("c", 1.0)
        stiffness = ALUMINIUM * candidate.area if strut else STEEL * CABLE_AREA
        for k in range(N_SIDES):
            ends = [node_id(s, k), node_id(t, k + shift)]
            length = float(np.linalg.norm(places[t][(k + shift) % N_SIDES] - places[s][k]))
            # Between two fixed nodes a difference has no effect but a cable that is slack as drawn.
            factor = 1.0 if set(ends) <= fixed else factors[family][k]
            count[letter] += 1
            members[f"{letter}{count[letter]}"] = {
                "kind": "strut" if strut else "cable",
                "nodes": ends,
                "material": "aluminium" if strut else "steel",
                "area": candidate.area if strut else CABLE_AREA,
                "rest_length": factor * length / (1.0 + sign * tension[kind] / stiffness),
                "groups": ["struts"] if strut else [_surface(k, k + shift), "classical"],
            }
    return members


def _clustered(candidate: Candidate, shape: Shape) -> dict[str, Any]:
    """Return the four clustered cables as a structure file has them."""
    places, factors, route = _places(shape), candidate.side_factors, candidate.layout.route
    members = {}
    for number, k in ((1, 1), (2, 2), (3, 3), (4, 0)):
        length = float(sum(np.linalg.norm(places[t][k] - places[s][k]) for s, t in pairwise(route)))
        stretch = 1.0 + candidate.self_stress / (STEEL * CABLE_AREA)
        members[f"K{number}"] = {
            "kind": "cable",
            "nodes": [node_id(s, k) for s in route],
            "material": "steel_rope",
            "area": CABLE_AREA,
            "rest_length": factors["clustered"][k] * length / stretch,
            "groups": ["clustered", "top_clustered" if number in {1, 4} else "bottom_clustered"],
        }
    return members


_ACTUATORS = {
    "A14": ["K1", "K4"],
    "A23": ["K2", "K3"],
    "A1": ["K1"],
    "A4": ["K4"],
    "A2": ["K2"],
    "A3": ["K3"],
}


def _surface(one: int, other: int) -> str:
    """Return on which surface a cable lies: between the top clustered cables, the bottom ones, or neither."""
    top = [k % N_SIDES in {0, 1} for k in (one, other)]
    return "top" if all(top) else "middle" if any(top) else "bottom"


def _supports(held: str) -> dict[str, str]:
    first = [node_id(0, k) for k in range(N_SIDES)]
    if held == "section":
        return dict.fromkeys(first, "xyz")
    if held == "stage":
        return dict.fromkeys([*first, *(node_id(1, k) for k in range(N_SIDES))], "xyz")
    return dict(zip(first, ("xyz", "xz", "x", "x"), strict=True))


def reference() -> Candidate:
    """Return the beam of the library as a candidate, from its coordinates and rest lengths.

    Examples
    --------
    >>> round(reference().self_stress)
    82
    """
    beam = tg.library.paper_beam()
    layout = reconstruction()
    place = np.array([[beam.nodes[node_id(s, k)] for k in range(N_SIDES)] for s in range(N_SECTIONS)])
    angle = np.arctan2(place[:, 0, 2], place[:, 0, 1])
    drawn = tg.solve_path(beam.replace(stages=(), gravity=(0, 0, 0))).final
    force = np.zeros(N_KINDS)
    for kind, s, t, shift in layout.segments():
        ends = {node_id(s, 0), node_id(t, shift)}
        if kind == N_KINDS - 1:
            continue
        force[kind] = next(
            abs(drawn.tension(name)) for name, m in beam.members.items() if set(m.nodes) == ends
        )
    force[-1] = drawn.tension("K1")
    shape = Shape(
        np.hypot(place[:, 0, 1], place[:, 0, 2]), np.unwrap(angle), place[:, 0, 0], force / force[-1]
    )
    steel = beam.materials["steel"].thermal_expansion
    alike = np.zeros(N_NUMBERS - N_SHAPE - 2)
    return Candidate(layout, np.concatenate([shape.to_vector(), np.log([force[-1], steel]), alike]))
