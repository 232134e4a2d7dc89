"""The planar D-bar: two crossing struts within four cables."""

from math import hypot

from tensegra.structure.library.stressed import require_positive, stressed_member
from tensegra.structure.parts import Actuator, Member
from tensegra.structure.structure import Structure
from tensegra.units import Units

__all__ = ["d_bar"]

_SI = Units()


def d_bar(
    half_width: float = 0.75,
    upper: float = 1.0,
    lower: float = 1.0,
    *,
    prestress: float = 1000.0,
    strut_stiffness: float = 1.0e7,
    cable_stiffness: float = 1.0e6,
    clustered: bool = True,
    units: Units = _SI,
) -> Structure:
    """Return a planar D-bar in its self-stressed equilibrium.

    A horizontal strut from `left` to `right` and a vertical one from `bottom` to `top` cross without
    touching. Two cables run from `left` and `right` to `bottom`; the upper two are one clustered
    cable ``over`` that runs from `left` over a pulley at `top` to `right`. With w, u, l for the half width
    and the upper and lower arm, and p, q for the force densities (tension over length) of the upper and
    the lower cables, equilibrium demands

        q = p u / l,   force of the vertical strut −2 p u,   of the horizontal one −w (p + q).

    With rigid members the top moves on a circle of radius upper + lower about the bottom, and the
    clustered cable, of fixed length, lets it move on an ellipse whose radius of curvature there is
    (half_width² + upper²) / upper. The structure stands where the circle is the flatter one,

        upper · lower > half_width²,

    and topples where it is not; equal arms (half_width = upper = lower) are the border.

    Parameters
    ----------
    half_width, upper, lower
        Distances of the four nodes from the crossing, lengths.
    prestress
        Tension of the upper cables, a force.
    strut_stiffness, cable_stiffness
        EA, forces.
    clustered
        False makes the upper cables two, ``over_left`` and ``over_right``; then it stands whatever
        its proportions.
    units
        The unit system of all these numbers.

    Returns
    -------
    Structure
        In the plane of x and y, held in z and, just as a rigid body, in the plane. With the groups
        `struts`, `over` (where it is no member) and `under`, and the actuators `over`, `under`,
        `under_left` and `under_right`, which shorten.

    Raises
    ------
    ModelError
        A number that is not positive, or a prestress beyond the struts.

    Notes
    -----
    The layout is that of the planar clustered D-bar among the examples of CTSFEM (S. Ma, M. Chen and
    R. E. Skelton), whose equal arms put it on the border. The D-bar of R. E. Skelton and M. C. de
    Oliveira, *Tensegrity Systems* (Springer, 2009), is its dual: four struts around two crossing cables.

    Examples
    --------
    >>> d_bar()
    Structure('d_bar': 4 nodes, 2 struts, 2 cables, 1 clustered; 5 free dof; units m, N)
    >>> from tensegra.mechanics import solve_path
    >>> solve_path(d_bar(half_width=0.9)).status, solve_path(d_bar(half_width=1.1)).status
    (<Status.STABLE: 'stable'>, <Status.UNSTABLE: 'unstable'>)
    """
    require_positive(
        "d_bar",
        half_width=half_width,
        upper=upper,
        lower=lower,
        prestress=prestress,
        strut_stiffness=strut_stiffness,
        cable_stiffness=cable_stiffness,
    )
    side_over, side_under = hypot(half_width, upper), hypot(half_width, lower)
    p = prestress / side_over
    q = p * upper / lower

    def strut(start: str, end: str, length: float, tension: float) -> Member:
        return stressed_member("strut", (start, end), length, tension, strut_stiffness, "struts")

    def cable(length: float, tension: float, group: str, *path: str) -> Member:
        return stressed_member("cable", path, length, tension, cable_stiffness, group)

    if clustered:
        over = {
            "over": stressed_member(
                "cable", ("left", "top", "right"), 2 * side_over, prestress, cable_stiffness
            )
        }
    else:
        over = {
            "over_left": cable(side_over, prestress, "over", "left", "top"),
            "over_right": cable(side_over, prestress, "over", "top", "right"),
        }
    members = {
        "across": strut("left", "right", 2 * half_width, -(p + q) * half_width),
        "upright": strut("bottom", "top", upper + lower, -2 * p * upper),
        **over,
        "under_left": cable(side_under, q * side_under, "under", "left", "bottom"),
        "under_right": cable(side_under, q * side_under, "under", "bottom", "right"),
    }
    return Structure(
        name="d_bar",
        units=units,
        nodes={
            "left": (-half_width, 0.0, 0.0),
            "top": (0.0, upper, 0.0),
            "right": (half_width, 0.0, 0.0),
            "bottom": (0.0, -lower, 0.0),
        },
        members=members,
        supports={"left": "xyz", "top": "z", "right": "yz", "bottom": "z"},
        actuators={
            "over": Actuator(tuple(over), "shorten"),
            "under": Actuator(("under_left", "under_right"), "shorten"),
            "under_left": Actuator(("under_left",), "shorten"),
            "under_right": Actuator(("under_right",), "shorten"),
        },
    )
