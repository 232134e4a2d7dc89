"""What a study's surrogates and analyses leave in the campaign's folder.

::

    results.json                  what there is, with keys, seeds, times and versions
    surrogates/<name>.tg          a fitted surrogate
    surrogates/<name>.parquet     the runs held out from it: inputs, true and predicted outputs
    analyses/<nn>-<name>.json     a result: statistics, indices, optimum
    analyses/<nn>-<name>.parquet  its table
    analyses/<nn>-<name>.trace.parquet   every evaluation of a search

A result carries a key, the hash of all that it depends on; what has the right key is not computed again.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tensegra import files
from tensegra.errors import StudyError
from tensegra.files import telling
from tensegra.study import Campaign
from tensegra.study.tablefile import read_parquet

if TYPE_CHECKING:
    import pandas as pd

    from tensegra.surrogate import Surrogate

__all__ = ["Index", "Results", "StoredAnalysis", "StoredSurrogate", "key_of", "open_results", "write_json"]

SCHEMA = "tensegra/results/1"
INDEX, SURROGATES, ANALYSES = "results.json", "surrogates", "analyses"


_AGAIN = "; delete it and run the study again on this folder, which makes it anew"


def _table(path: Path) -> "pd.DataFrame":
    """Read a table that a run has left."""
    try:
        table: pd.DataFrame = read_parquet(path, str(path.parent))
    except StudyError as error:
        raise StudyError(f"{error}{_AGAIN}") from None
    return table


@dataclass(frozen=True)
class StoredSurrogate:
    """A surrogate in the campaign's folder.

    Attributes
    ----------
    name, folder
        Its name in the study, and where it is.
    """

    name: str
    folder: Path

    @property
    def path(self) -> Path:
        """The surrogate's file."""
        return self.folder / f"{self.name}.tg"

    @cached_property
    def surrogate(self) -> "Surrogate":
        """The surrogate."""
        from tensegra.surrogate import load

        return load(self.path)

    @property
    def held_out_path(self) -> Path:
        """The file of the runs that it was measured on."""
        return self.folder / f"{self.name}.parquet"

    def held_out(self) -> "pd.DataFrame":
        """Return those runs: inputs, ``<output>``, ``<output>_predicted`` and, if known, ``<output>_std``."""
        return _table(self.held_out_path)


@dataclass(frozen=True)
class StoredAnalysis:
    """The result of an analysis in the campaign's folder.

    Attributes
    ----------
    kind, name, entry
        ``propagation``, ``sensitivity`` or ``optimisation``; its title; number of its entry in the study.
    stem
        Path of its files without their suffixes.
    seconds
        Time that it took.
    """

    kind: str
    name: str
    entry: int
    stem: Path
    seconds: float

    @property
    def path(self) -> Path:
        """The file of the result."""
        return self.stem.with_name(self.stem.name + ".json")

    @cached_property
    def content(self) -> dict[str, Any]:
        """The result as `to_dict` of the analysis gave it, without a trace."""
        try:
            return dict(json.loads(self.path.read_text(encoding="utf-8")))
        except FileNotFoundError:
            raise StudyError(f"{self.path}: no such file{_AGAIN}") from None
        except (OSError, ValueError, TypeError, RecursionError) as error:
            raise StudyError(f"{self.path}: cannot be read ({error}){_AGAIN}") from None

    @property
    def table_path(self) -> Path:
        """The file of the result's table."""
        return self.stem.with_name(self.stem.name + ".parquet")

    @property
    def trace_path(self) -> Path:
        """The file of every evaluation of a search; an analysis that is no search has none."""
        return self.stem.with_name(self.stem.name + ".trace.parquet")

    def table(self) -> "pd.DataFrame":
        """Return the result as rows."""
        return _table(self.table_path)

    def trace(self) -> "pd.DataFrame":
        """Return every evaluation of a search."""
        return _table(self.trace_path)


@dataclass
class Index:
    """The content of ``results.json`` while it is being made."""

    surrogates: dict[str, dict[str, Any]] = field(default_factory=dict)
    analyses: list[dict[str, Any]] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    finished: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    workers: int = 0

    @classmethod
    def read(cls, folder: Path) -> "Index":
        """Read the index of a campaign's folder; an empty one if there is none or it is of another format."""
        try:
            content = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return cls()
        if not isinstance(content, dict) or content.pop("schema", None) != SCHEMA:
            return cls()
        expected = vars(cls())
        if content.keys() - expected.keys() or any(
            not isinstance(value, type(expected[key])) for key, value in content.items()
        ):
            return cls()
        return cls(**content)

    def write(self, folder: Path) -> None:
        """Write the index; it is there as a whole, or as it was."""
        write_json(folder / INDEX, {"schema": SCHEMA, **vars(self)})


@dataclass(frozen=True, eq=False)
class Results:
    """A campaign with the surrogates and analyses that its folder holds.

    Attributes
    ----------
    campaign
        The runs.
    index
        What else there is.
    """

    campaign: Campaign
    index: Index

    @property
    def folder(self) -> Path:
        """The campaign's folder."""
        return self.campaign.folder

    @cached_property
    def surrogates(self) -> dict[str, StoredSurrogate]:
        """The surrogates by their names in the study."""
        return {name: StoredSurrogate(name, self.folder / SURROGATES) for name in self.index.surrogates}

    @cached_property
    def analyses(self) -> tuple[StoredAnalysis, ...]:
        """The results of the analyses, in the order of the study."""
        return tuple(
            StoredAnalysis(
                kind=entry["kind"],
                name=entry["name"],
                entry=entry["entry"],
                stem=self.folder / ANALYSES / entry["stem"],
                seconds=entry["seconds"],
            )
            for entry in self.index.analyses
        )

    @property
    def succeeded(self) -> bool:
        """Whether all that the study asks for could be had."""
        return not self.index.failures

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values, as `tensegra run --json` prints them."""
        from tensegra.report.study_tables import reasons_by_kind

        state = self.campaign.state()
        study = self.campaign.study
        return {
            "study": study.name,
            "fingerprint": study.fingerprint,
            "folder": str(self.folder),
            "n_points": state.n_points,
            "n_done": state.n_done,
            "statuses": state.statuses,
            "reasons": reasons_by_kind(state),
            "surrogates": {
                name: {
                    "file": str(stored.path),
                    "kind": stored.surrogate.kind,
                    "n_train": stored.surrogate.n_train,
                    "seconds": stored.surrogate.seconds,
                    "validation": _without_infinities(stored.surrogate.validation),
                }
                for name, stored in self.surrogates.items()
            },
            "analyses": [
                {
                    "kind": analysis.kind,
                    "name": analysis.name,
                    "file": str(analysis.path),
                    "seconds": analysis.seconds,
                }
                for analysis in self.analyses
            ],
            "failures": self.index.failures,
            "seconds": self.index.seconds,
        }


def open_results(campaign: Campaign) -> Results:
    """Open what a campaign's folder holds beside the runs; an entry without its file is left out."""
    results = Results(campaign, Index.read(campaign.folder))
    index = results.index
    index.surrogates = {
        name: index.surrogates[name] for name, s in results.surrogates.items() if s.path.is_file()
    }
    index.analyses = [e for e, a in zip(index.analyses, results.analyses, strict=True) if a.path.is_file()]
    return Results(campaign, index)


def key_of(*parts: object) -> str:
    """Return the hash of plain values on which a result depends."""
    return sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON without NaN, and the folders that lead to it; the file appears complete or not at all.

    Raises
    ------
    StudyError
        It cannot be written.
    """
    with telling(path, StudyError):
        path.parent.mkdir(parents=True, exist_ok=True)
    files.write_json(path, content, StudyError)


def _without_infinities(validation: Any) -> dict[str, Any] | None:  # noqa: ANN401 - a Validation or None
    if validation is None:
        return None
    content: dict[str, Any] = validation.to_dict()
    return content
