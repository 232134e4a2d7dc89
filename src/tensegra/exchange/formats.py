"""The formats that there are: a new one is a file beside this one and a line here."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tensegra.errors import ModelError
from tensegra.exchange import compas, datafiles, dxf, gltf, matrices, mujoco_read, mujoco_write, tables, vtk
from tensegra.exchange.datasets import Dataset, dataset_of_scene
from tensegra.exchange.said import Content, Said
from tensegra.exchange.scene import Scene
from tensegra.structure.load import LOADERS

__all__ = ["FORMATS", "Format", "format_for"]


@dataclass(frozen=True)
class Format:
    """How a kind of file is read and written.

    Attributes
    ----------
    name
        By which it can be asked for where the suffix does not tell.
    suffix
        Of its files.
    about
        What it is, in a few words.
    read
        Returns the structure that a file describes; None where it does not describe one.
    write
        Writes a structure or a path.
    write_runs
        Writes many runs, or the rows of a campaign; None where it cannot hold them.
    many_shapes
        Whether `write` takes the many shapes of a batch, too.
    """

    name: str
    suffix: str
    about: str
    read: Callable[[Path, Said], Content] | None = None
    write: Callable[[Scene, Path], None] | None = None
    write_runs: Callable[[Dataset, Path], None] | None = None
    many_shapes: bool = False


def _write_frames(scene: Scene, path: Path) -> None:
    datafiles.write_netcdf(dataset_of_scene(scene), path)


FORMATS = (
    Format("mat", ".mat", "MATLAB's matrices", matrices.read_mat, matrices.write_mat, datafiles.write_mat),
    Format("npz", ".npz", "NumPy's arrays", matrices.read_npz, matrices.write_npz, datafiles.write_npz),
    Format("csv", ".csv", "tables of nodes and members", tables.read, tables.write, datafiles.write_csv),
    Format("dxf", ".dxf", "a drawing", dxf.read, dxf.write),
    Format("compas", ".json", "a graph of COMPAS", compas.read, compas.write),
    Format("mujoco", ".xml", "a model of MuJoCo", mujoco_read.read, mujoco_write.write),
    Format("vtu", ".vtu", "one position, for ParaView", write=vtk.write_vtu),
    Format("pvd", ".pvd", "all positions, for ParaView", write=vtk.write_pvd, many_shapes=True),
    Format("gltf", ".gltf", "a scene, for browsers and Blender", write=gltf.write),
    Format("nc", ".nc", "NetCDF", write=_write_frames, write_runs=datafiles.write_netcdf),
)


def format_for(path: Path, name: str | None = None, *, can: str = "read or write") -> Format:
    """Return the format of a file: the one named, else that of the suffix.

    Parameters
    ----------
    path, name
        The file; the name of a format, where it is said.
    can
        What it has to be able to do, for the message: ``read`` or ``write``.

    Raises
    ------
    ModelError
        There is none.

    Examples
    --------
    >>> format_for(Path("tower.DXF")).about
    'a drawing'
    """
    able = [form for form in FORMATS if can not in {"read", "write"} or getattr(form, can) is not None]
    if name is not None:
        for form in able:
            if form.name == name:
                return form
        known = [form.name for form in able]
        raise ModelError.at("format", name, f"one of {', '.join(known)} to {can}", candidates=known)
    for form in able:
        # A .json without more words is a structure's own.
        if form.suffix == path.suffix.lower() and form.name != "compas":
            return form
    others = dict.fromkeys(form.suffix for form in able if form.name != "compas")
    expected = f"a file named .yaml, .yml or .json, or of another program, to {can}: {', '.join(others)}"
    raise ModelError.at(path.name, path.suffix, expected, candidates=(*LOADERS, *others))
