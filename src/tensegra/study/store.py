"""The folder of a campaign: shards of rows, a manifest, the resolved study.

::

    manifest.json        whose rows these are: fingerprint, units, versions, seed
    study.json           the resolved study
    points.parquet       the points of a design that came from a file
    shards/*.parquet     rows, each shard written once and renamed into place; nothing else is there
    broken/*.parquet     shards that could not be read any more, set aside
    lock                 held by the process that runs the campaign

A row is known by its inputs, to the bit: to which points of the design it belongs follows from them,
so the design may grow or change its order and no row is lost or solved again. Only the driver
writes; a shard that is there is whole.
"""

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.files import is_draft, replacing, telling
from tensegra.study.derivatives import derivative_name
from tensegra.study.evaluate import Runs
from tensegra.study.study import RUN_COLUMNS, Study

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

__all__ = ["SCHEMA", "Store", "read_manifest", "require_same_study", "row_keys"]

SCHEMA = "tensegra/campaign/1"

SAFE = "; the shards that are there are whole, run again to go on"
"""What a failure to write says to who fears for the runs."""

MANIFEST, STUDY, POINTS, SHARDS = "manifest.json", "study.json", "points.parquet", "shards"
BROKEN = "broken"

PACKAGES = ("tensegra", "numpy", "scipy", "numba", "pandas", "pyarrow")

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Store:
    """The rows of one campaign.

    Parameters
    ----------
    folder
        Its folder.
    inputs, outputs, derivatives
        Names of the columns of the variables, of the outputs and of their derivatives.
    """

    folder: Path
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    derivatives: tuple[str, ...] = ()

    @classmethod
    def of(cls, folder: Path, study: Study) -> "Store":
        """Return the store of a study's campaign in a folder, whether there is one or not."""
        return cls(folder, study.input_names, study.output_names, study.derivative_names)

    @property
    def shards(self) -> Path:
        """The folder of the shards."""
        return self.folder / SHARDS

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns, in order."""
        return (*self.inputs, *self.outputs, *RUN_COLUMNS, *self.derivatives)

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
        with replacing(path, StudyError, SAFE) as file:
            # A sum of each page tells a shard that has been altered from one that has not; numbers
            # that hardly repeat are no matter for a dictionary.
            pq.write_table(table, file, write_page_checksum=True, use_dictionary=["status", "reason"])
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
            *self._derivatives(runs),
        ]
        schema = self.schema
        arrays = [
            # NaN becomes null: a run that has no result has no number.
            pa.array(np.ascontiguousarray(value), type=field.type, from_pandas=True)
            for value, field in zip(values, schema, strict=True)
        ]
        return pa.Table.from_arrays(arrays, schema=schema)

    def _derivatives(self, runs: Runs) -> list[NDArray[np.float64]]:
        """Return the columns of the derivatives, in the order of their names."""
        if runs.dY is None:
            return []
        columns = {
            derivative_name(output, variable): runs.dY[:, i, j]
            for i, output in enumerate(self.outputs)
            for j, variable in enumerate(self.inputs)
        }
        return [columns[name] for name in self.derivatives]

    def read(self, columns: Sequence[str] | None = None) -> "pd.DataFrame":
        """Return all rows, shard by shard, a row that two shards hold once.

        Parameters
        ----------
        columns
            The columns wanted beside the inputs; all if left out.

        Raises
        ------
        StudyError
            If a shard cannot be read.
        """
        import pyarrow as pa

        wanted = [name for name in self.columns if columns is None or name in columns or name in self.inputs]
        tables = []
        for path in self.paths():
            try:
                tables.append(_read(path, wanted))
            except (pa.ArrowException, OSError) as error:
                raise StudyError(
                    f"{path}: cannot be read ({_first_line(error)}); run the study again on this folder, "
                    "which solves the runs of this shard anew"
                ) from None
        schema = pa.schema([self.schema.field(name) for name in wanted])
        table = pa.concat_tables(tables) if tables else schema.empty_table()
        frame: pd.DataFrame = table.replace_schema_metadata(None).to_pandas()
        repeated = frame.duplicated(list(self.inputs))
        return frame[~repeated].reset_index(drop=True)

    def paths(self) -> list[Path]:
        """Return the shards in order of their names."""
        return sorted(path for path in self.shards.glob("*.parquet") if not path.name.startswith("."))

    def repair(self) -> list[Path]:
        """Remove what a killed driver was writing, and set aside shards that are not whole.

        Every shard is read and its sums are compared; that takes a second for some million rows.

        Returns
        -------
        list of Path
            The shards set aside; their runs will be solved again.
        """
        import pyarrow as pa

        for folder in (self.folder, self.shards):
            for left_over in filter(is_draft, folder.iterdir()):
                left_over.unlink()
        broken = []
        for path in self.paths():
            try:
                _read(path, list(self.columns))
            except (pa.ArrowException, OSError) as error:
                logger.warning(
                    "%s cannot be read (%s); it is set aside in %s, and its runs are solved again",
                    path,
                    _first_line(error),
                    self.folder / BROKEN,
                )
                (self.folder / BROKEN).mkdir(exist_ok=True)
                broken.append(path.replace(self.folder / BROKEN / path.name))
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
        store = cls.of(folder, study)
        require_same_study(folder, study)
        with telling(folder, StudyError, SAFE):
            store.shards.mkdir(exist_ok=True)
        mapping = study.to_mapping()
        if study.points is not None:
            import pyarrow as pa
            import pyarrow.parquet as pq

            points = pa.table(dict(zip(study.input_names, np.ascontiguousarray(study.points.T), strict=True)))
            with replacing(folder / POINTS, StudyError, SAFE) as file:
                pq.write_table(points, file)
            mapping["design"] = {"sampler": "file", "file": POINTS}
        _write_json(folder / STUDY, mapping)
        # Last, so that a folder with a manifest has all the rest.
        _write_json(folder / MANIFEST, _manifest(study))
        return store


def row_keys(X: NDArray[np.float64]) -> list[bytes]:
    """Return the identity of each row: its numbers, to the bit."""
    rows = np.ascontiguousarray(X, dtype=np.float64)
    as_bytes: Any = rows.view(np.dtype((np.void, rows.itemsize * rows.shape[1])))
    keys: list[bytes] = as_bytes.ravel().tolist()
    return keys


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
    except (OSError, ValueError, RecursionError) as error:
        raise StudyError(f"{folder / MANIFEST}: cannot be read ({error})") from None
    found = manifest.get("schema") if isinstance(manifest, dict) else None
    if found != SCHEMA:
        raise StudyError.at(f"{folder / MANIFEST}: schema", found, SCHEMA)
    for key in ("fingerprint", "study"):
        if not isinstance(manifest.get(key), str):
            found = manifest.get(key, "nothing")
            raise StudyError.at(f"{folder / MANIFEST}: {key}", found, "a text; the manifest is damaged")
    return dict(manifest)


def require_same_study(folder: Path, study: Study) -> None:
    """Refuse a folder that holds another campaign, or something else.

    Raises
    ------
    StudyError
        Naming what is there, or in what the studies differ.
    """
    if not (folder / MANIFEST).exists():
        known = {"lock", SHARDS, STUDY, POINTS, BROKEN}
        others = [path.name for path in folder.iterdir() if path.name not in known and not is_draft(path)]
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
        "solver": study.solver.written(),
        "derivatives": study.derivatives,
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


def _read(path: Path, columns: list[str]) -> "pa.Table":
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(path, columns=columns, partitioning=None, page_checksum_verification=True)
    if table.column_names != columns:
        raise pa.ArrowException("its columns are others")
    return table


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0].rstrip(".")


@cache
def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    with replacing(path, StudyError, SAFE) as file:
        file.write(text.encode())
