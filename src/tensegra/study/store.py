"""The folder of a campaign: shards of rows, a manifest, the resolved study.

::

    manifest.json        whose rows these are: fingerprint, units, versions, seed
    study.json           the resolved study
    points.parquet       the points of a design that came from a file
    shards/*.parquet     rows, each shard written once and renamed into place
    lock                 held by the process that runs the campaign

A row is known by its inputs, to the bit: to which points of the design it belongs follows from them,
so the design may grow or change its order and no row is lost or solved again. Only the driver
writes; a shard that is there is whole.
"""

import contextlib
import json
import logging
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.study.evaluate import Runs
from tensegra.study.study import RUN_COLUMNS, Study

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

__all__ = ["SCHEMA", "Store", "row_keys"]

SCHEMA = "tensegra/campaign/1"

MANIFEST, STUDY, POINTS, SHARDS = "manifest.json", "study.json", "points.parquet", "shards"
TEMPORARY, BROKEN = ".writing", ".broken"

PACKAGES = ("tensegra", "numpy", "scipy", "numba", "pandas", "pyarrow")

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Store:
    """The rows of one campaign.

    Parameters
    ----------
    folder
        Its folder.
    inputs, outputs
        Names of the columns of the variables and of the outputs.
    """

    folder: Path
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def shards(self) -> Path:
        """The folder of the shards."""
        return self.folder / SHARDS

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns, in order."""
        return (*self.inputs, *self.outputs, *RUN_COLUMNS)

    @property
    def schema(self) -> "pa.Schema":
        """Names and types of the columns of every shard."""
        import pyarrow as pa

        types = {
            "status": pa.string(),
            "reason": pa.string(),
            "steps": pa.int32(),
            "iterations": pa.int32(),
        }
        return pa.schema(
            [pa.field(name, types.get(name, pa.float64())) for name in self.columns],
            metadata={"schema": SCHEMA, "tensegra": _version("tensegra")},
        )

    def write(self, runs: Runs, first: int) -> Path:
        """Store solved runs as a shard of their own; it is there as a whole, or not at all.

        Parameters
        ----------
        runs
            Solved design points.
        first
            Index of the first of them in the design; a part of the shard's name, for readers.

        Raises
        ------
        StudyError
            If it cannot be written, for want of space for example.
        """
        import pyarrow.parquet as pq

        name = f"{first:08d}-{sha256(runs.X.tobytes()).hexdigest()[:12]}.parquet"
        table = self._table(runs)
        path = self.shards / name
        with _replacing(path) as file:
            pq.write_table(table, file)
        return path

    def _table(self, runs: Runs) -> "pa.Table":
        import pyarrow as pa

        values = [
            *runs.X.T,
            *runs.Y.T,
            runs.status,
            runs.reason,
            runs.residual,
            runs.lowest_eigenvalue,
            runs.steps,
            runs.iterations,
            runs.seconds,
        ]
        schema = self.schema
        arrays = [
            # NaN becomes null: a run that has no result has no number.
            pa.array(np.ascontiguousarray(value), type=field.type, from_pandas=True)
            for value, field in zip(values, schema, strict=True)
        ]
        return pa.Table.from_arrays(arrays, schema=schema)

    def read(self, columns: Sequence[str] | None = None) -> "pd.DataFrame":
        """Return all rows, shard by shard, a row that two shards hold once.

        Parameters
        ----------
        columns
            The columns wanted beside the inputs; all if left out.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        wanted = [name for name in self.columns if columns is None or name in columns or name in self.inputs]
        tables = [pq.read_table(path, columns=wanted, partitioning=None) for path in self.paths()]
        schema = pa.schema([self.schema.field(name) for name in wanted])
        table = pa.concat_tables(tables) if tables else schema.empty_table()
        frame: pd.DataFrame = table.replace_schema_metadata(None).to_pandas()
        repeated = frame.duplicated(list(self.inputs))
        return frame[~repeated].reset_index(drop=True)

    def paths(self) -> list[Path]:
        """Return the shards in order of their names."""
        return sorted(self.shards.glob("*.parquet"))

    def count_since(self, moment: float) -> int:
        """Return the number of rows in shards written after a moment, in seconds since the epoch."""
        import pyarrow.parquet as pq

        recent = [path for path in self.paths() if path.stat().st_mtime >= moment]
        return sum(int(pq.read_metadata(path).num_rows) for path in recent)

    def repair(self) -> list[Path]:
        """Remove what a killed driver was writing, and set aside shards that cannot be read.

        Returns
        -------
        list of Path
            The shards set aside; their runs will be solved again.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        for folder in (self.folder, self.shards):
            for left_over in folder.glob(f"*{TEMPORARY}"):
                left_over.unlink()
        broken = []
        for path in self.paths():
            try:
                readable = pq.read_schema(path).names == list(self.columns)
            except (pa.ArrowException, OSError):
                readable = False
            if not readable:
                logger.warning("%s cannot be read; set aside as %s, its runs are solved again", path, BROKEN)
                broken.append(path.rename(path.with_name(path.name + BROKEN)))
        return broken

    @classmethod
    def prepare(cls, folder: Path, study: Study) -> "Store":
        """Create the folder of a campaign, or open it if it is this study's.

        The caller holds the folder's lock. The manifest and the resolved study are written anew, since
        the design may have grown.

        Raises
        ------
        StudyError
            If the folder holds another campaign, or something else.
        """
        store = cls(folder, study.input_names, study.output_names)
        _require_same_study(folder, study)
        with _writing(folder):
            store.shards.mkdir(exist_ok=True)
        mapping = study.to_mapping()
        if study.points is not None:
            import pyarrow as pa
            import pyarrow.parquet as pq

            points = pa.table(dict(zip(study.input_names, np.ascontiguousarray(study.points.T), strict=True)))
            with _replacing(folder / POINTS) as file:
                pq.write_table(points, file)
            mapping["design"] = {"sampler": "file", "file": POINTS}
        _write_json(folder / STUDY, mapping)
        # Last, so that a folder with a manifest has all the rest.
        _write_json(folder / MANIFEST, _manifest(study))
        return store


def row_keys(X: NDArray[np.float64]) -> list[bytes]:
    """Return the identity of each row: its numbers, to the bit."""
    return [row.tobytes() for row in np.ascontiguousarray(X, dtype=np.float64)]


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a campaign.

    Raises
    ------
    StudyError
        If the folder holds no campaign, or one of another format.
    """
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise StudyError(f"{folder}: no campaign is here (there is no {MANIFEST})") from None
    except (OSError, ValueError) as error:
        raise StudyError(f"{folder / MANIFEST}: cannot be read ({error})") from None
    found = manifest.get("schema") if isinstance(manifest, dict) else None
    if found != SCHEMA:
        raise StudyError.at(f"{folder / MANIFEST}: schema", found, SCHEMA)
    return dict(manifest)


def _require_same_study(folder: Path, study: Study) -> None:
    if not (folder / MANIFEST).exists():
        known = {"lock", SHARDS, STUDY, POINTS}
        others = [
            path.name for path in folder.iterdir() if path.name not in known and path.suffix != TEMPORARY
        ]
        if others:
            raise StudyError(f"{folder}: found {others[0]!r} and no campaign, expected a new or empty folder")
        return
    manifest = read_manifest(folder)
    if manifest["fingerprint"] != study.fingerprint:
        differs = [part for part, value in _identity(study).items() if manifest.get(part) != value]
        raise StudyError(
            f"{folder}: holds the campaign of another study, {manifest['study']!r}, of which "
            f"{' and '.join(differs) or 'the meaning of the results'} differ; choose another folder"
        )


def _identity(study: Study) -> dict[str, Any]:
    """Return what makes a study the same, in parts that a message can name."""
    return {
        "structure": study.structure.fingerprint,
        "variables": {variable.name: variable.to_mapping() for variable in study.variables},
        "correlation": None if study.space.correlation is None else study.space.correlation.tolist(),
        "outputs": {output.name: output.to_mapping() for output in study.outputs},
    }


def _manifest(study: Study) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "study": study.name,
        "fingerprint": study.fingerprint,
        **_identity(study),
        "units": {variable.name: variable.unit for variable in study.variables}
        | {output.name: output.unit for output in study.outputs},
        "design": study.design.written(),
        "seed": study.seed,
        "n_points": study.n_points,
        "versions": {package: _version(package) for package in PACKAGES},
    }


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    with _replacing(path) as file:
        file.write(text.encode())


@contextlib.contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Turn a failure to write into a message that says what is safe and what to do."""
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise StudyError(
            f"{folder}: cannot write ({reason}); the shards that are there are whole, run again to go on"
        ) from error


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file that takes the place of `path` once it is whole and on the disk."""
    temporary = path.with_name(path.name + TEMPORARY)
    with _writing(path.parent):
        try:
            with temporary.open("wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise
        _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Bring a renaming to the disk, where the system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
