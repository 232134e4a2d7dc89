"""Structures from and to the files of other programs, by their suffix."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from tensegra.errors import ModelError
from tensegra.structure import Structure, write_structure
from tensegra.structure import read_structure as read_own
from tensegra.structure.load import LOADERS

if TYPE_CHECKING:
    from tensegra.mechanics import Batch, EquilibriumPath
    from tensegra.study import Campaign

__all__ = ["Saved", "read_structure", "save"]

Saved: TypeAlias = "Structure | EquilibriumPath | Batch | Campaign"

Quantity = float | str


def read_structure(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,  # noqa: A002 — the word of every library
    unit: str | None = None,
    force_unit: str | None = None,
    strut_stiffness: Quantity | None = None,
    cable_stiffness: Quantity | None = None,
    struts: tuple[str, ...] = (),
    cables: tuple[str, ...] = (),
) -> Structure:
    """Read a structure from a file, of tensegra's own format or of another program's, by its suffix.

    Parameters
    ----------
    path
        A structure file (.yaml, .yml or .json), or a file of another program: matrices (.mat, .npz),
        tables (.csv), a drawing (.dxf), a graph of COMPAS (.json) or a model of MuJoCo (.xml).
    format
        The name of the format, where the suffix does not tell: mat, npz, csv, dxf, compas or mujoco.
    unit, force_unit
        Units of the numbers in another program's file, such as "mm" and "kN"; what the file says, or
        else metre and newton, if left out.
    strut_stiffness, cable_stiffness
        EA of the members for which another program's file has none: a number in `force_unit`, or a
        quantity such as "2 MN".
    struts, cables
        Layers of a drawing whose lines are struts, or cables; those left out are told by their names.

    Raises
    ------
    ModelError
        The file cannot be read, what it describes cannot be, or something is left to say. The message
        gives the file, the place in it, what was found and what was expected.

    Examples
    --------
    >>> read_structure("beam.yml")
    Traceback (most recent call last):
    tensegra.errors.ModelError: beam.yml: no such file
    """
    path = Path(path)
    suffix = path.suffix.lower()
    # A structure file needs none of the formats, nor the compiled mechanics that they write.
    nothing_said = not any((format, unit, force_unit, strut_stiffness, cable_stiffness, struts, cables))
    if nothing_said and suffix in LOADERS and suffix != ".json":
        return read_own(path)
    from tensegra.exchange.compas import is_compas
    from tensegra.exchange.formats import format_for
    from tensegra.exchange.said import Said, structure_of

    said = Said(unit, force_unit, strut_stiffness, cable_stiffness, tuple(struts), tuple(cables))
    if format is None and suffix in LOADERS:
        if suffix != ".json" or not path.is_file() or not is_compas(path):
            if said != Said():
                raise ModelError(f"{path.name}: a structure file says its units and stiffnesses itself")
            return read_own(path)
        format = "compas"  # noqa: A001 — idem
    form = format_for(path, format, can="read")
    assert form.read is not None  # noqa: S101 — asked for
    content = form.read(path, said)
    name = path.stem.removesuffix("_nodes").removesuffix("_members") if form.name == "csv" else path.stem
    return structure_of(content, said, source=path.name, name=name)


def save(what: Saved, path: str | os.PathLike[str], format: str | None = None) -> None:  # noqa: A002 — idem
    """Write a structure as drawn, a path, many runs or a campaign; see `tensegra.Structure.save`.

    Raises
    ------
    ModelError
        No format has this suffix or name, the format cannot hold this, the library that it needs is
        not installed, or the file cannot be written.
    """
    path = Path(path)
    if isinstance(what, Structure) and format is None and path.suffix.lower() in LOADERS:
        write_structure(what, path)
        return
    from tensegra.exchange.datasets import dataset_of_batch, dataset_of_campaign
    from tensegra.exchange.formats import FORMATS, format_for
    from tensegra.exchange.scene import scene_of
    from tensegra.mechanics import Batch
    from tensegra.study import Campaign

    form = format_for(path, format, can="write")
    if isinstance(what, Batch | Campaign) and form.write_runs is not None:
        form.write_runs(
            dataset_of_batch(what) if isinstance(what, Batch) else dataset_of_campaign(what), path
        )
        return
    if isinstance(what, Campaign):
        expected = (
            "a format of numbers (.csv, .mat, .npz, .nc): its rows have no shapes; a structure's path has"
        )
        raise ModelError.at("save", f"a campaign for {form.suffix}", expected)
    if isinstance(what, Batch) and not form.many_shapes:
        many = [other.suffix for other in FORMATS if other.write_runs or other.many_shapes]
        raise ModelError.at(
            "save", f"many runs for {path.suffix}", f"one structure or path, or one of {', '.join(many)}"
        )
    assert form.write is not None  # noqa: S101 — asked for
    form.write(scene_of(what), path)
