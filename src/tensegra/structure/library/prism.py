"""Tensegrity prisms: n struts between two twisted regular polygons."""

from math import cos, dist, pi, sin

from tensegra.structure.coerce import Vector
from tensegra.structure.library.stressed import require_count, require_positive, stressed_member
from tensegra.structure.parts import Actuator, Kind, Member
from tensegra.structure.structure import Structure
from tensegra.units import Units

__all__ = ["prism"]

_SI = Units()


def prism(
    n_struts: int = 3,
    radius: float = 1.0,
    height: float = 1.0,
    *,
    top_radius: float | None = None,
    prestress: float = 1000.0,
    strut_stiffness: float = 1.0e7,
    cable_stiffness: float = 1.0e6,
    clustered: bool = False,
    units: Units = _SI,
) -> Structure:
    """Return a tensegrity prism in its self-stressed equilibrium.

    Nodes ``b0, b1, …`` form the bottom polygon and ``t0, t1, …`` the top one, turned against it by
    π/2 − π/n. Vertical cables ``v0, …`` join b_i to t_i, struts ``s0, …`` join b_i to t_{i+1}, and
    cables ``c0, …`` (bottom) and ``h0, …`` (top) the polygons' sides. With r, R the radii below and
    above, and q a force density (tension over length), equilibrium of the nodes demands

        q_strut = −q_v,   q_bottom = q_v R / (2 r sin(π/n)),   q_top = q_v r / (2 R sin(π/n)),

    whatever the height. Rest lengths follow from these tensions, so that the coordinates given are
    an equilibrium free of load. Six coordinates of the bottom are supported, just enough to hold the
    prism in space without a reaction.

    Parameters
    ----------
    n_struts
        At least three.
    radius, top_radius
        Radii of the polygons' circumscribed circles, lengths; the top one equals the bottom one if
        left out.
    height
        Distance of the polygons, a length.
    prestress
        Tension of each vertical cable, a force.
    strut_stiffness, cable_stiffness
        EA, forces.
    clustered
        Make the top polygon one closed loop ``loop`` over frictionless pulleys. The symmetry gives
        all its sides one tension, as the loop needs. The loop frees mechanisms that the prestress must
        stiffen: with three struts it does; with more it does so in flat prisms only. Four struts with
        equal radii stand at a height of 0.7 radii, and not at one radius: an unstable equilibrium.
    units
        The unit system of all these numbers.

    Returns
    -------
    Structure
        With the groups `struts`, `bottom`, `vertical` and `top`, and the actuator `top` that shortens
        the top polygon.

    Raises
    ------
    ModelError
        Fewer than three struts, a number that is not positive, or a prestress beyond the struts.

    Notes
    -----
    The twist is that of R. Connelly and M. Terrell, "Globally rigid symmetric tensegrities",
    Structural Topology 21 (1995) 59–78; for the self-stress see also J. Y. Zhang, S. D. Guest and
    M. Ohsaki, "Symmetric prismatic tensegrity structures: Part I", International Journal of Solids
    and Structures 46 (2009) 1–14.

    Examples
    --------
    >>> prism()
    Structure('prism-3': 6 nodes, 3 struts, 9 cables, 0 clustered; 12 free dof; units m, N)
    >>> prism(4, clustered=True)
    Structure('prism-4': 8 nodes, 4 struts, 8 cables, 1 clustered; 18 free dof; units m, N)
    """
    n = n_struts
    top_radius = radius if top_radius is None else top_radius
    require_count("prism", 3, n_struts=n)
    require_positive(
        "prism",
        radius=radius,
        top_radius=top_radius,
        height=height,
        prestress=prestress,
        strut_stiffness=strut_stiffness,
        cable_stiffness=cable_stiffness,
    )
    # The side from b0 to b1 lies along x, so that y at b1 is what still has to be held.
    start = -pi / 2 - pi / n
    nodes = {
        **{f"b{i}": _on_circle(radius, start + 2 * pi * i / n, 0.0) for i in range(n)},
        **{f"t{i}": _on_circle(top_radius, start + pi / 2 + pi * (2 * i - 1) / n, height) for i in range(n)},
    }
    q = prestress / dist(nodes["b0"], nodes["t0"])
    q_bottom = q * top_radius / (2 * radius * sin(pi / n))
    q_top = q * radius / (2 * top_radius * sin(pi / n))

    def member(kind: Kind, group: str, path: list[str], force_density: float) -> Member:
        side = dist(nodes[path[0]], nodes[path[1]])
        stiffness = cable_stiffness if kind == "cable" else strut_stiffness
        length = (len(path) - 1) * side
        return stressed_member(kind, tuple(path), length, force_density * side, stiffness, group)

    bottom = {f"c{i}": member("cable", "bottom", [f"b{i}", f"b{(i + 1) % n}"], q_bottom) for i in range(n)}
    vertical = {f"v{i}": member("cable", "vertical", [f"b{i}", f"t{i}"], q) for i in range(n)}
    struts = {f"s{i}": member("strut", "struts", [f"b{i}", f"t{(i + 1) % n}"], -q) for i in range(n)}
    if clustered:
        top = {"loop": member("cable", "top", [f"t{i % n}" for i in range(n + 1)], q_top)}
    else:
        top = {f"h{i}": member("cable", "top", [f"t{i}", f"t{(i + 1) % n}"], q_top) for i in range(n)}
    return Structure(
        name=f"prism-{n}",
        units=units,
        nodes=nodes,
        members={**struts, **bottom, **vertical, **top},
        supports={"b0": "xyz", "b1": "yz", "b2": "z"},
        actuators={"top": Actuator(tuple(top), "shorten")},
    )


def _on_circle(radius: float, angle: float, height: float) -> Vector:
    return (radius * cos(angle), radius * sin(angle), height)
