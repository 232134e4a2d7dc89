"""The von Mises truss: two struts that snap through."""

from tensegra.structure.library.stressed import require_positive
from tensegra.structure.parts import Member
from tensegra.structure.structure import Structure, path_length
from tensegra.units import Units

__all__ = ["von_mises_truss"]

_SI = Units()


def von_mises_truss(
    half_span: float = 1.0, height: float = 0.2, *, stiffness: float = 1.0e6, units: Units = _SI
) -> Structure:
    """Return two struts from `left` and `right` to `apex`, free of stress: the classic of snap-through.

    With half span a, height h and l₀² = a² + h², the apex stands at the height z under the downward load

        P(z) = 2 EA (1/l − 1/l₀) z,   l² = a² + z²,

    whose limit points are where l³ = l₀ a².

    Parameters
    ----------
    half_span, height
        Of the apex from a support and above it; lengths.
    stiffness
        EA of each strut, a force.
    units
        The unit system of all these numbers.

    Returns
    -------
    Structure
        In the plane of x and z: the apex is held along y.

    Raises
    ------
    ModelError
        A number that is not positive.

    Notes
    -----
    R. von Mises, "Über die Stabilitätsprobleme der Elastizitätstheorie", Zeitschrift für angewandte
    Mathematik und Mechanik 3 (1923) 406–422.

    Examples
    --------
    >>> von_mises_truss()
    Structure('von_mises_truss': 3 nodes, 2 struts, 0 cables, 0 clustered; 2 free dof; units m, N)
    """
    require_positive("von_mises_truss", half_span=half_span, height=height, stiffness=stiffness)
    nodes = {
        "left": (-half_span, 0.0, 0.0),
        "apex": (0.0, 0.0, height),
        "right": (half_span, 0.0, 0.0),
    }
    length = path_length(nodes, ("left", "apex"))
    return Structure(
        name="von_mises_truss",
        units=units,
        nodes=nodes,
        members={
            f"s{i}": Member("strut", path, length, stiffness=stiffness)
            for i, path in enumerate((("left", "apex"), ("apex", "right")), start=1)
        },
        supports={"left": "xyz", "apex": "y", "right": "xyz"},
    )
