"""A chain of links that hangs under its own weight."""

from itertools import pairwise
from math import hypot

from tensegra.structure.library.stressed import require_count, require_positive
from tensegra.structure.parts import Material, Member
from tensegra.structure.structure import Structure
from tensegra.units import Units

__all__ = ["hanging_chain"]

_SI = Units()

# Halvings that take any bracket down to neighbouring floats; passes for weights of stretched links.
_HALVINGS = 200
_PASSES = 50


def hanging_chain(
    n_links: int = 10,
    span: float = 8.0,
    length: float = 10.0,
    *,
    weight: float = 1.0,
    stiffness: float = 1.0e4,
    units: Units = _SI,
) -> Structure:
    """Return a chain between two supports at one height, drawn where it hangs.

    The links ``k0, k1, …`` join ``n0`` (held) to ``n{n_links}`` (held). With the horizontal thrust H, the
    vertical force of link k is V_k = V_0 − (weight of the nodes 1 to k), its tension √(H² + V_k²), and
    H is such that the links' horizontal extents add up to the span. For many stiff links the shape is
    the catenary z = c cosh(x/c) with c = H / weight.

    Parameters
    ----------
    n_links
        At least two.
    span, length
        Between the supports, and of the whole chain free of stress; lengths. A chain shorter than the
        span is a taut one.
    weight
        Per length, a force per length.
    stiffness
        EA, a force.
    units
        The unit system of all these numbers.

    Returns
    -------
    Structure
        With gravity along −z.

    Raises
    ------
    ModelError
        Fewer than two links, or a number that is not positive.

    Notes
    -----
    H. M. Irvine, *Cable Structures* (MIT Press, 1981), gives the elastic catenary that it tends to.

    Examples
    --------
    >>> hanging_chain()
    Structure('hanging_chain-10': 11 nodes, 0 struts, 10 cables, 0 clustered; 27 free dof; units m, N)
    >>> from tensegra.mechanics import solve_path
    >>> solve_path(hanging_chain()).status
    <Status.STABLE: 'stable'>
    """
    require_count("hanging_chain", 2, n_links=n_links)
    require_positive("hanging_chain", span=span, length=length, weight=weight, stiffness=stiffness)
    links = [length / n_links] * n_links
    for _ in range(_PASSES):
        # The weight of a link is that of its drawn length, and so grows with its stretch.
        nodal = [0.5 * weight * (a + b) for a, b in pairwise(links)]
        x, z, drawn = _hang(nodal, span, length / n_links, stiffness)
        if drawn == links:
            break
        links = drawn
    return Structure(
        name=f"hanging_chain-{n_links}",
        units=units,
        nodes={f"n{i}": (x[i], 0.0, z[i]) for i in range(n_links + 1)},
        materials={"rope": Material(youngs_modulus=stiffness, weight=weight)},
        members={
            f"k{i}": Member("cable", (f"n{i}", f"n{i + 1}"), length / n_links, material="rope", area=1.0)
            for i in range(n_links)
        },
        supports={"n0": "xyz", f"n{n_links}": "xyz"},
        gravity=(0.0, 0.0, -1.0),
    )


def _hang(
    nodal: list[float], span: float, rest_length: float, stiffness: float
) -> tuple[list[float], list[float], list[float]]:
    """Return the nodes' x and z and the links' lengths under the weights of the inner nodes."""
    vertical = [0.5 * sum(nodal)]
    for load in nodal:
        vertical.append(vertical[-1] - load)

    def lengths(thrust: float) -> list[float]:
        return [rest_length * (1.0 + hypot(thrust, v) / stiffness) for v in vertical]

    def reach(thrust: float) -> float:
        links = zip(lengths(thrust), vertical, strict=True)
        return sum(link * thrust / hypot(thrust, v) for link, v in links)

    low, high = 0.0, vertical[0]
    while reach(high) < span:
        low, high = high, 2.0 * high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reach(middle) < span else (low, middle)
    x, z = [0.0], [0.0]
    for link, v in zip(lengths(high), vertical, strict=True):
        x.append(x[-1] + link * high / hypot(high, v))
        z.append(z[-1] - link * v / hypot(high, v))
    x[-1], z[-1] = span, 0.0
    return x, z, lengths(high)
