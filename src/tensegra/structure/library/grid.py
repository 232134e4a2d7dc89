"""Cable nets within a held border, flat or saddle-shaped."""

from math import dist

from tensegra.errors import ModelError
from tensegra.structure.coerce import Vector
from tensegra.structure.library.stressed import require_count, require_positive, stressed_member
from tensegra.structure.parts import Actuator, Member
from tensegra.structure.structure import Structure
from tensegra.units import Units

__all__ = ["grid"]

_SI = Units()


def grid(
    nx: int = 8,
    ny: int = 8,
    spacing: float = 1.0,
    rise: float = 0.0,
    *,
    prestress: float = 1000.0,
    cable_stiffness: float = 1.0e6,
    clustered: bool = False,
    units: Units = _SI,
) -> Structure:
    """Return a net of cables in its prestressed equilibrium: a square grid in plan.

    Nodes ``n{i}_{j}`` stand at (i spacing, j spacing) in plan, 0 ≤ i < nx and 0 ≤ j < ny, without the
    four corners; those on the border are held. Cables ``x{i}_{j}`` and ``y{i}_{j}`` run from the node
    n{i}_{j} to the next along x and y. With u and v from −1 to 1 across the net, the net lies on

        z = rise (u² − v²),

    so that cables along x hang and those along y arch (a hyperbolic paraboloid). Second differences
    of z along each line of nodes are constant, hence a uniform force density (tension over length) in
    each direction balances every node: q_x / (nx − 1)² = q_y / (ny − 1)². A flat net has tension
    `prestress` throughout.

    Parameters
    ----------
    nx, ny
        Nodes in each direction, at least three.
    spacing
        Between neighbours in plan, a length.
    rise
        Height of the border's middle above the net's middle, where x ends; zero for a flat net.
    prestress
        Tension that the cables along x have in plan (their horizontal component), a force.
    cable_stiffness
        EA, a force.
    clustered
        Make each line along x one cable over frictionless pulleys, ``x{j}``; flat nets only, for a curved
        line has no uniform tension here.
    units
        The unit system of all these numbers.

    Returns
    -------
    Structure
        With the groups and actuators `x` and `y`, which shorten.

    Raises
    ------
    ModelError
        A count too small, a number that is not positive, or a clustered net with a rise.

    Notes
    -----
    Nets of given force densities are those of H.-J. Schek, "The force density method for form finding
    and computation of general networks", Computer Methods in Applied Mechanics and Engineering 3
    (1974) 115–134.

    Examples
    --------
    >>> grid(8, 6, rise=0.5)
    Structure('grid-8x6': 44 nodes, 0 struts, 58 cables, 0 clustered; 72 free dof; units m, N)
    >>> from tensegra.mechanics import solve_path
    >>> solve_path(grid(8, 6, rise=0.5), loads={("n3_2", "z"): -50.0}).status
    <Status.STABLE: 'stable'>
    """
    require_count("grid", 3, nx=nx, ny=ny)
    require_positive("grid", spacing=spacing, prestress=prestress, cable_stiffness=cable_stiffness)
    if clustered and rise != 0.0:
        raise ModelError.at("grid: rise", rise, "0 where the lines along x are clustered")
    nodes = {
        f"n{i}_{j}": _position(i, j, nx, ny, spacing, rise)
        for i in range(nx)
        for j in range(ny)
        if 0 < i < nx - 1 or 0 < j < ny - 1
    }
    q_x = prestress / spacing
    q_y = q_x if rise == 0.0 else q_x * ((ny - 1) / (nx - 1)) ** 2

    def cable(start: str, end: str, force_density: float, group: str) -> Member:
        length = dist(nodes[start], nodes[end])
        return stressed_member("cable", (start, end), length, force_density * length, cable_stiffness, group)

    if clustered:
        along_x = {
            f"x{j}": stressed_member(
                "cable",
                tuple(f"n{i}_{j}" for i in range(nx)),
                (nx - 1) * spacing,
                prestress,
                cable_stiffness,
                "x",
            )
            for j in range(1, ny - 1)
        }
    else:
        along_x = {
            f"x{i}_{j}": cable(f"n{i}_{j}", f"n{i + 1}_{j}", q_x, "x")
            for j in range(1, ny - 1)
            for i in range(nx - 1)
        }
    along_y = {
        f"y{i}_{j}": cable(f"n{i}_{j}", f"n{i}_{j + 1}", q_y, "y")
        for i in range(1, nx - 1)
        for j in range(ny - 1)
    }
    border = [f"n{i}_{j}" for j in range(1, ny - 1) for i in (0, nx - 1)]
    border += [f"n{i}_{j}" for i in range(1, nx - 1) for j in (0, ny - 1)]
    return Structure(
        name=f"grid-{nx}x{ny}",
        units=units,
        nodes=nodes,
        members={**along_x, **along_y},
        supports=dict.fromkeys(border, "xyz"),
        actuators={
            "x": Actuator(tuple(along_x), "shorten"),
            "y": Actuator(tuple(along_y), "shorten"),
        },
    )


def _position(i: int, j: int, nx: int, ny: int, spacing: float, rise: float) -> Vector:
    u, v = 2.0 * i / (nx - 1) - 1.0, 2.0 * j / (ny - 1) - 1.0
    return (i * spacing, j * spacing, rise * (u * u - v * v))
