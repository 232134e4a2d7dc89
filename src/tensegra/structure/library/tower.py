"""Towers: tensegrity prisms stacked node on node."""

from math import cos, dist, pi, sin
from typing import Literal

from tensegra.errors import ModelError
from tensegra.structure.coerce import Vector
from tensegra.structure.library.stressed import require_count, require_positive, stressed_member
from tensegra.structure.parts import Actuator, Member
from tensegra.structure.structure import Structure
from tensegra.units import Units

__all__ = ["tower"]

_SI = Units()

Clustered = Literal["none", "one", "full"]


def tower(
    n_stages: int = 5,
    n_struts: int = 4,
    radius: float = 1.0,
    stage_height: float = 1.0,
    *,
    clustered: Clustered = "none",
    guided_every: int | None = None,
    prestress: float = 5.0e3,
    strut_stiffness: float = 2.0e6,
    cable_stiffness: float = 1.0e6,
    units: Units = _SI,
) -> Structure:
    """Return a tower of prisms in its self-stressed equilibrium, standing on a pinned ring.

    Rings of nodes ``r0_0, r0_1, …`` (the ground) to ``r{n_stages}_0, …`` are joined by one prism a
    stage, turned by π/2 − π/n one way and the other in turn, so that every other ring is above the
    ground ring. Stage j has the struts ``s{j}_{i}`` and the vertical cables ``v{j}_{i}``; ring j has
    the cables ``c{j}_{i}``. Every vertical cable over one foot, taken together, is the chain
    ``chain{i}``, and it is as long as the tower.

    The self-stress is the sum of the prisms' own (`tensegra.structure.library.prism`): with q the force
    density of the verticals, −q in the struts and q / sin(π/n) in the rings, half of that in the first
    and the last. A tower without clustered cables has one state of self-stress and one infinitesimal
    mechanism a stage, and stands however long: each prism's stress matrix is positive semidefinite.

    Parameters
    ----------
    n_stages, n_struts
        Prisms, and struts in each: at least one and three. The tower has n_struts (n_stages + 1) nodes.
    radius, stage_height
        Of the rings' circumscribed circles, and between rings; lengths.
    clustered
        Which chains are one cable over frictionless pulleys, from the ground to the top: ``none``,
        ``one`` (``chain0``) or ``full`` (all, which leaves a single state of self-stress). The tower then
        resists bending by its prestress alone.
    guided_every
        Hold every so many-th ring along x and y, as guys hold a mast. A tower that stands free has a
        lowest eigenvalue that falls with the fourth power of its height: with some hundred stages it
        is lost in rounding. None guides no ring. Where all chains of a guided tower are long cables,
        stages can take length from each other: shortened together by about a percent, it buckles.
    prestress
        Tension of each vertical cable, a force.
    strut_stiffness, cable_stiffness
        EA, forces.
    units
        The unit system of all these numbers.

    Returns
    -------
    Structure
        With the groups `struts`, `vertical`, `rings` and, where it is no member itself, ``chain{i}``; the
        actuators ``chain{i}`` shorten one chain (the tower bends), `chains` all (it sinks).

    Raises
    ------
    ModelError
        A count too small, a number that is not positive, or a prestress beyond the struts.

    Notes
    -----
    H. Murakami and Y. Nishimura, "Initial shape finding and modal analyses of cyclic right-cylindrical
    tensegrity modules", Computers & Structures 79 (2001) 891–917, treat the module and its towers;
    that prisms are stable whatever their material and prestress is due to R. Connelly and M. Terrell,
    "Globally rigid symmetric tensegrities", Structural Topology 21 (1995) 59–78.

    Examples
    --------
    >>> tower(5)
    Structure('tower-5x4': 24 nodes, 20 struts, 44 cables, 0 clustered; 60 free dof; units m, N)
    >>> from tensegra.mechanics import solve_path
    >>> bent = solve_path(tower(5, clustered="full"), {"chain0": 0.02})
    >>> bent.status, bent.displacement("x", nodes=["r5_0", "r5_1", "r5_2", "r5_3"]) > 0.1
    (<Status.STABLE: 'stable'>, True)
    """
    n = n_struts
    require_count("tower", 1, n_stages=n_stages)
    require_count("tower", 3, n_struts=n)
    if guided_every is not None:
        require_count("tower", 1, guided_every=guided_every)
    require_positive(
        "tower",
        radius=radius,
        stage_height=stage_height,
        prestress=prestress,
        strut_stiffness=strut_stiffness,
        cable_stiffness=cable_stiffness,
    )
    choices = {"none": 0, "one": 1, "full": n}
    if clustered not in choices:
        raise ModelError.at("tower: clustered", clustered, "none, one or full", candidates=choices)
    rings = [_ring(j, n, radius, stage_height) for j in range(n_stages + 1)]
    struts, vertical = _stages(
        rings, prestress, strut_stiffness, cable_stiffness, n_clustered=choices[clustered]
    )
    side = 2.0 * radius * sin(pi / n)
    q_end = prestress / _vertical_length(rings) / (2.0 * sin(pi / n))
    ring_cables = {}
    for j, ring in enumerate(rings):
        tension = side * q_end * (1.0 if j in (0, n_stages) else 2.0)
        ids = list(ring)
        for i in range(n):
            path = (ids[i], ids[(i + 1) % n])
            ring_cables[f"c{j}_{i}"] = stressed_member("cable", path, side, tension, cable_stiffness, "rings")
    chains = [_chain(vertical, i) for i in range(n)]
    guided = range(guided_every, n_stages + 1, guided_every) if guided_every else range(0)
    return Structure(
        name=f"tower-{n_stages}x{n}",
        units=units,
        nodes={node: position for ring in rings for node, position in ring.items()},
        members={**struts, **vertical, **ring_cables},
        supports={
            **dict.fromkeys(rings[0], "xyz"),
            **{node: "xy" for j in guided for node in rings[j]},
        },
        actuators={
            **{f"chain{i}": Actuator(chain, "shorten") for i, chain in enumerate(chains)},
            "chains": Actuator(tuple(vertical), "shorten"),
        },
    )


def _ring(j: int, n: int, radius: float, stage_height: float) -> dict[str, Vector]:
    """Return the nodes of ring j, on which stages of alternate twist leave every other ring unturned."""
    start = (pi / 2 - pi / n) * (j % 2)
    return {
        f"r{j}_{i}": (
            radius * cos(start + 2 * pi * i / n),
            radius * sin(start + 2 * pi * i / n),
            j * stage_height,
        )
        for i in range(n)
    }


def _vertical_length(rings: list[dict[str, Vector]]) -> float:
    return dist(rings[0]["r0_0"], rings[1]["r1_0"])


def _stages(
    rings: list[dict[str, Vector]],
    prestress: float,
    strut_stiffness: float,
    cable_stiffness: float,
    *,
    n_clustered: int,
) -> tuple[dict[str, Member], dict[str, Member]]:
    """Return the struts and the vertical cables, the first `n_clustered` chains as one cable each."""
    n, n_stages = len(rings[0]), len(rings) - 1
    length = _vertical_length(rings)
    strut_length = dist(rings[0]["r0_0"], rings[1]["r1_1"])
    compression = prestress / length * strut_length
    struts, vertical = {}, {}
    for j in range(n_stages):
        step = 1 if j % 2 == 0 else -1
        for i in range(n):
            path = (f"r{j}_{i}", f"r{j + 1}_{(i + step) % n}")
            struts[f"s{j}_{i}"] = stressed_member(
                "strut", path, strut_length, -compression, strut_stiffness, "struts"
            )
    for i in range(n):
        nodes = tuple(f"r{j}_{i}" for j in range(n_stages + 1))
        if i < n_clustered:
            vertical[f"chain{i}"] = stressed_member(
                "cable", nodes, n_stages * length, prestress, cable_stiffness, "vertical"
            )
            continue
        for j in range(n_stages):
            vertical[f"v{j}_{i}"] = stressed_member(
                "cable", nodes[j : j + 2], length, prestress, cable_stiffness, "vertical", f"chain{i}"
            )
    return struts, vertical


def _chain(vertical: dict[str, Member], i: int) -> tuple[str, ...]:
    name = f"chain{i}"
    return tuple(member for member in vertical if member == name or name in vertical[member].groups)
