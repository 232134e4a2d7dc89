"""Strains of the members, and whether the linear law still holds there.

The formulation is exact for any displacement, but its members follow a linear law: T = EA ε. A real material
does so for small strains alone. An equilibrium beyond them is a root of the equations and no shape that the
structure can take.
"""

import numpy as np

from tensegra.mechanics.arrays import FloatArray
from tensegra.structure import Structure

__all__ = ["beyond_law", "strain_limits", "strain_warning"]


def strain_limits(structure: Structure) -> FloatArray:
    """Return the strain of each member up to which its linear law is trusted, shape ``(n_members,)``."""
    return np.array([structure.strain_limit(member) for member in structure.members])


def beyond_law(structure: Structure, strains: FloatArray) -> tuple[str, ...]:
    """Return the names of the members whose strain is beyond their limit.

    Parameters
    ----------
    structure
        The structure.
    strains
        Of its members, tension positive, shape ``(n_members,)``; NaN is beyond nothing.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> beam = library.von_mises_truss()
    >>> beyond_law(beam, np.array([0.2, -0.01]))[0] == beam.member_ids[0]
    True
    """
    names = np.array(list(structure.members), dtype=object)
    return tuple(names[np.abs(strains) > strain_limits(structure)])


def strain_warning(structure: Structure, strains: FloatArray) -> str:
    """Say which member is strained farthest beyond the limit of its law; ``""`` where none is."""
    beyond = beyond_law(structure, strains)
    if not beyond:
        return ""
    share = np.nan_to_num(np.abs(strains) / strain_limits(structure))
    worst = int(np.argmax(share))
    name = list(structure.members)[worst]
    members = f"{len(beyond)} members are" if len(beyond) > 1 else "1 member is"
    return (
        f"{members} strained beyond what the linear law holds for, most of all {name} "
        f"({100 * float(strains[worst]):.3g} %, limit {100 * structure.strain_limit(name):g} %): no shape "
        "that the structure can take"
    )
