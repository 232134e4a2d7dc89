"""Levy's cable dome: floating struts between triangulated ridges, diagonals and closed hoops."""

from dataclasses import dataclass
from math import cos, dist, pi, sin
from typing import Literal

from tensegra.errors import ModelError
from tensegra.structure.coerce import Vector
from tensegra.structure.library.stressed import require_count, require_positive, stressed_member
from tensegra.structure.parts import Actuator, Member
from tensegra.structure.structure import Structure
from tensegra.units import Units

__all__ = ["levy_dome"]

_SI = Units()

Group = Literal["struts", "ridges", "diagonals", "hoops"]


def levy_dome(
    n_sides: int = 8,
    n_hoops: int = 2,
    radius: float = 10.0,
    rise: float = 2.0,
    strut_length: float = 2.5,
    *,
    prestress: float = 1.0e5,
    strut_stiffness: float = 2.0e8,
    cable_stiffness: float = 2.0e7,
    clustered: bool = True,
    units: Units = _SI,
) -> Structure:
    """Return a Levy dome in its self-stressed equilibrium, hung in a held ring.

    The ring ``a0, a1, …`` is held. Within it stand n_hoops rings of n_sides vertical struts, from
    ``b{j}_{i}`` below to ``t{j}_{i}`` on the paraboloid z = rise (1 − (r / radius)²), j = 1 next to the
    held ring, each turned by π/n_sides against the last, and one strut from `cb` to `ct` in the centre.
    Two ridges join every top to the ring outside it and two diagonals every bottom to the tops outside
    it; the bottoms of a ring are joined by a hoop. The centre's top and bottom hang on one ridge and one
    diagonal from each top of the innermost ring.

    One state of self-stress has the symmetry of the dome. It follows node by node from the centre
    outwards: radial and vertical balance of a top give its outer ridges and its strut, those of a bottom
    its diagonals and its hoop. By symmetry a hoop has one tension, as a closed cable needs.

    Parameters
    ----------
    n_sides, n_hoops
        Struts in a ring, at least three; rings, at least one.
    radius, rise, strut_length
        Of the held ring, of the centre above it, and of all struts; lengths.
    prestress
        Tension of the outermost hoop, a force.
    strut_stiffness, cable_stiffness
        EA, forces.
    clustered
        Make each hoop a closed loop ``hoop{j}`` over frictionless pulleys at the bottoms; otherwise it is
        the group ``hoop{j}`` of the cables ``h{j}_{i}``.
    units
        The unit system of all these numbers.

    Returns
    -------
    Structure
        With the groups `struts`, `ridges`, `diagonals` and `hoops`; the actuators ``hoop{j}``, `hoops` and
        `diagonals` shorten, `struts` lengthens.

    Raises
    ------
    ModelError
        A count too small, a number that is not positive, or proportions in which a cable would be
        compressed or a strut pulled.

    Notes
    -----
    The layout is that of M. P. Levy, "The Georgia Dome and beyond: achieving lightweight-longspan
    structures", Proc. IASS-ASCE International Symposium (1994) 560–562; for the self-stress of domes
    ring by ring see X. Yuan, L. Chen and S. Dong, "Prestress design of cable domes with new forms",
    International Journal of Solids and Structures 44 (2007) 2773–2782.

    Examples
    --------
    >>> levy_dome()
    Structure('levy_dome-8x2': 42 nodes, 17 struts, 80 cables, 2 clustered; 102 free dof; units m, N)
    >>> from tensegra.mechanics import solve_path
    >>> path = solve_path(levy_dome(), {"hoop1": 0.02})
    >>> path.status, path.displacement("z", nodes=["ct"]) > 0.0
    (<Status.STABLE: 'stable'>, True)
    """
    require_count("levy_dome", 3, n_sides=n_sides)
    require_count("levy_dome", 1, n_hoops=n_hoops)
    require_positive(
        "levy_dome",
        radius=radius,
        rise=rise,
        strut_length=strut_length,
        prestress=prestress,
        strut_stiffness=strut_stiffness,
        cable_stiffness=cable_stiffness,
    )
    shape = _Shape(n_sides, n_hoops, radius, rise, strut_length)
    nodes = _nodes(shape)
    force_densities = _force_densities(shape)
    chord = 2.0 * shape.radius_of(1) * sin(pi / n_sides)
    scale = prestress / (force_densities["hoops", 1] * chord)
    members: dict[str, Member] = {}
    for group, ring, name, path in _paths(shape, clustered=clustered):
        side = dist(nodes[path[0]], nodes[path[1]])
        stiffness = strut_stiffness if group == "struts" else cable_stiffness
        groups = (group, f"hoop{ring}") if group == "hoops" and not clustered else (group,)
        members[name] = stressed_member(
            "strut" if group == "struts" else "cable",
            path,
            (len(path) - 1) * side,
            scale * force_densities[group, ring] * side,
            stiffness,
            *groups,
        )

    def of(group: str) -> tuple[str, ...]:
        return tuple(name for name, member in members.items() if group in (name, *member.groups))

    return Structure(
        name=f"levy_dome-{n_sides}x{n_hoops}",
        units=units,
        nodes=nodes,
        members=members,
        supports={f"a{i}": "xyz" for i in range(n_sides)},
        actuators={
            **{f"hoop{j}": Actuator(of(f"hoop{j}"), "shorten") for j in range(1, n_hoops + 1)},
            "hoops": Actuator(of("hoops"), "shorten"),
            "diagonals": Actuator(of("diagonals"), "shorten"),
            "struts": Actuator(of("struts"), "lengthen"),
        },
    )


@dataclass(frozen=True)
class _Shape:
    n_sides: int
    n_hoops: int
    radius: float
    rise: float
    strut_length: float

    def radius_of(self, ring: int) -> float:
        """Rings lie at equal distances, the held one being number 0 and the centre n_hoops + 1."""
        return self.radius * (1.0 - ring / (self.n_hoops + 1))

    def top_of(self, ring: int) -> float:
        return self.rise * (1.0 - (self.radius_of(ring) / self.radius) ** 2)


def _nodes(shape: _Shape) -> dict[str, Vector]:
    def ring_of(name: str, ring: int, height: float) -> dict[str, Vector]:
        n, r = shape.n_sides, shape.radius_of(ring)
        angles = [pi / n * (2 * i + ring % 2) for i in range(n)]
        return {f"{name}{i}": (r * cos(angle), r * sin(angle), height) for i, angle in enumerate(angles)}

    nodes = ring_of("a", 0, 0.0)
    for j in range(1, shape.n_hoops + 1):
        nodes |= ring_of(f"t{j}_", j, shape.top_of(j))
        nodes |= ring_of(f"b{j}_", j, shape.top_of(j) - shape.strut_length)
    return nodes | {"ct": (0.0, 0.0, shape.rise), "cb": (0.0, 0.0, shape.rise - shape.strut_length)}


def _paths(shape: _Shape, *, clustered: bool) -> list[tuple[Group, int, str, tuple[str, ...]]]:
    """Return group, ring, name and nodes of each member."""
    n, m = shape.n_sides, shape.n_hoops
    paths: list[tuple[Group, int, str, tuple[str, ...]]] = []
    for j in range(1, m + 1):
        outside = "a" if j == 1 else f"t{j - 1}_"
        for i in range(n):
            paths.append(("struts", j, f"s{j}_{i}", (f"b{j}_{i}", f"t{j}_{i}")))
            # Odd rings are turned forwards by half a side, so their neighbours outside are i and i + 1.
            for side, k in (("l", i if j % 2 else i - 1), ("r", i + 1 if j % 2 else i)):
                paths.append(("ridges", j, f"r{j}_{i}{side}", (f"t{j}_{i}", f"{outside}{k % n}")))
                paths.append(("diagonals", j, f"d{j}_{i}{side}", (f"b{j}_{i}", f"{outside}{k % n}")))
        loop = tuple(f"b{j}_{i % n}" for i in range(n + 1))
        if clustered:
            paths.append(("hoops", j, f"hoop{j}", loop))
        else:
            paths.extend(("hoops", j, f"h{j}_{i}", loop[i : i + 2]) for i in range(n))
    for i in range(n):
        paths.append(("ridges", m + 1, f"r{m + 1}_{i}", ("ct", f"t{m}_{i}")))
        paths.append(("diagonals", m + 1, f"d{m + 1}_{i}", ("cb", f"t{m}_{i}")))
    paths.append(("struts", m + 1, "sc", ("cb", "ct")))
    return paths


def _force_densities(shape: _Shape) -> dict[tuple[Group, int], float]:
    """Solve the balance of the nodes from the centre outwards, with 1 in the ridges of the centre."""
    n, m, depth = shape.n_sides, shape.n_hoops, shape.strut_length
    inner_ridge = 1.0
    strut = -n * inner_ridge * (shape.rise - shape.top_of(m)) / depth
    inner_diagonal = -strut * depth / (n * (shape.top_of(m) - shape.rise + depth))
    densities: dict[tuple[Group, int], float] = {
        ("ridges", m + 1): inner_ridge,
        ("diagonals", m + 1): inner_diagonal,
        ("struts", m + 1): strut,
    }
    n_inner, spread = 1, 0.0
    for j in range(m, 0, -1):
        r, z = shape.radius_of(j), shape.top_of(j)
        # The ring inside: one neighbour at the centre, two at ±π/n anywhere else.
        r_in, z_in = shape.radius_of(j + 1) * cos(spread), shape.top_of(j + 1)
        r_out, z_out = shape.radius_of(j - 1) * cos(pi / n), shape.top_of(j - 1)
        inwards = n_inner * (inner_ridge + inner_diagonal) * (r - r_in)
        upwards = n_inner * (inner_ridge * (z_in - z) + inner_diagonal * (z_in - depth - z))
        ridge = inwards / (2.0 * (r_out - r)) if r_out > r else 0.0
        strut = (upwards + 2.0 * ridge * (z_out - z)) / depth
        height = z_out - z + depth
        diagonal = -strut * depth / (2.0 * height) if height > 0.0 else 0.0
        if ridge <= 0.0 or strut >= 0.0 or diagonal <= 0.0:
            raise ModelError.at(
                "levy_dome",
                f"n_sides {n}, n_hoops {m}, rise {shape.rise:g}, strut_length {depth:g}",
                f"more sides, fewer hoops or longer struts: ring {j} has no self-stress with the right signs",
            )
        densities["ridges", j] = ridge
        densities["struts", j] = strut
        densities["diagonals", j] = diagonal
        densities["hoops", j] = diagonal * (r_out - r) / (r * (1.0 - cos(2.0 * pi / n)))
        inner_ridge, inner_diagonal, n_inner, spread = ridge, diagonal, 2, pi / n
    return densities
