"""Changes to a structure, written with the keys of its file."""

from collections.abc import Mapping
from typing import Any

from tensegra.structure.fileformat import build
from tensegra.structure.mapping import structure_to_mapping
from tensegra.structure.plain import merged, plain
from tensegra.structure.problems import InvalidStructureError, Problem
from tensegra.structure.structure import Structure

__all__ = ["apply_changes"]


def apply_changes(structure: Structure, changes: Mapping[Any, Any]) -> Structure:
    """Return the structure with changes merged into what its file would hold, checked anew.

    Mappings are merged key by key, None removes a key and anything else, lists included, takes the
    place of what was (RFC 7396). Numbers are in the structure's units, quantities may carry their own.
    Rest lengths stay as they are when nodes move; ``"rest_length": None`` measures one anew.

    Parameters
    ----------
    structure
        Stays as it is.
    changes
        The keys of ``tensegra/structure/1``, except `schema` and `units`.

    Raises
    ------
    ModelError
        The changed structure cannot be; places begin with ``changes.``.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> changed = apply_changes(
    ...     library.paper_beam(),
    ...     {"gravity": [0, 0, 0], "members": {"K1": {"rest_length": "4.4 m"}}},
    ... )
    >>> changed.gravity, changed.members["K1"].rest_length
    ((0.0, 0.0, 0.0), 440.0)
    """
    root = ("changes",)
    try:
        wanted = plain(changes)
    except InvalidStructureError as error:
        raise InvalidStructureError.of(error.problems, root=root) from None
    for key in ("schema", "units"):
        if key in wanted:
            problem = Problem((), key, "another key: the numbers that stay are in the structure's own units")
            raise InvalidStructureError.of([problem], root=root)
    return build(
        merged(structure_to_mapping(structure), wanted), name=structure.name, root=root, written=wanted
    )
