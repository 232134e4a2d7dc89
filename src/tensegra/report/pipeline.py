"""From a study to its results: campaign, surrogates, analyses, each only where it is missing."""

import logging
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from tensegra.errors import StudyError
from tensegra.files import replacing
from tensegra.report.results import ANALYSES, SURROGATES, Index, Results, key_of, write_json
from tensegra.report.soundness import require_known_parts, require_sound
from tensegra.report.study_tables import title_of
from tensegra.study import AnalysisEntry, Campaign, Study, SurrogateEntry, TrainingData, design_points
from tensegra.study.analyses import TRUTH
from tensegra.study.driver import require_folder
from tensegra.study.executors import executor_for

if TYPE_CHECKING:
    import pandas as pd

    from tensegra.surrogate import RegimeData, Surrogate

__all__ = ["Listener", "carry_out", "versions"]

logger = logging.getLogger(__name__)

HELD_OUT = 0.2
"""Share of the runs that a surrogate is measured on, where its entry says nothing."""

PACKAGES = (
    "tensegra",
    "numpy",
    "scipy",
    "numba",
    "jax",
    "scikit-learn",
    "hdbscan",
    "SALib",
    "pandas",
    "pyarrow",
)


class Listener(Protocol):
    """What is told of the progress of a long job."""

    def __call__(self, task: str, done: int, total: int, note: str = "", /) -> None:
        """Hear that `done` of `total` parts of a task are done; a `total` of 0 means that nobody knows."""


def deaf(task: str, done: int, total: int, note: str = "", /) -> None:
    """Do nothing with what is told."""


def carry_out(
    study: Study,
    folder: str | Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    listener: Listener = deaf,
    resume: bool = True,
    only: Collection[str] = (),
) -> Results:
    """Run a study's design, fit its surrogates and carry out its analyses, all in a folder.

    What is there already, and was made from the same things, is kept.

    Parameters
    ----------
    study
        The study.
    folder
        The campaign's folder, created or resumed.
    workers
        Processes of a local Dask cluster that solve the runs; 1 for this one, on all its threads.
    scheduler
        Address of a Dask scheduler instead.
    listener
        Told of the progress.
    resume
        Whether to keep surrogates and analyses that are there; runs are always kept.
    only
        Surrogates and analyses by their names, or a kind of analysis: of those that are missing, these alone
        are made, and what they need. All if left out.

    Returns
    -------
    Results
        Its `index.failures` say what could not be had.

    Raises
    ------
    StudyError
        If the study cannot be carried out as it is written, or the folder belongs to another one.
    """
    require_sound(study)
    require_known_parts(study, only)
    # Refused before anything is done: an address that cannot be one, a folder of something else.
    executor_for(workers, scheduler)
    require_folder(Path(folder), study)
    began = time.perf_counter()
    # Compiled here once, and kept on the disk: each worker would do it for itself.
    listener("kernels", 0, 1, "compiled once, which may take half a minute")
    study.evaluate(design_points(study)[:1])
    listener("kernels", 1, 1)
    compiled = time.perf_counter()

    def runs_done(done: int, total: int, failed: int) -> None:
        listener("runs", done, total, f"{failed} failed" if failed else "")

    campaign = study.run(folder, workers, scheduler=scheduler, progress=runs_done)
    index = Index.read(campaign.folder) if resume else Index()
    index.failures, index.workers = [], workers
    index.seconds["campaign"] = time.perf_counter() - compiled
    index.versions = versions()
    wanted = Wanted.of(study, only)
    surrogates = _surrogates(campaign, index, wanted, listener)
    _analyses(campaign, surrogates, index, wanted, listener)
    index.finished = datetime.now(UTC).isoformat(timespec="seconds")
    index.seconds["total"] = time.perf_counter() - began
    index.write(campaign.folder)
    return Results(campaign, index)


@dataclass(frozen=True)
class Wanted:
    """What is made where it is missing: names of surrogates, numbers of analyses."""

    surrogates: frozenset[str]
    analyses: frozenset[int]

    @classmethod
    def of(cls, study: Study, only: Collection[str]) -> "Wanted":
        """Return all, or those named with the surrogates that they ask."""
        if not only:
            return cls(frozenset(study.surrogates), frozenset(range(len(study.analyses))))
        analyses = [
            i for i, entry in enumerate(study.analyses) if {title_of(entry, i), entry.kind} & set(only)
        ]
        asked = {name for i in analyses for name in _models(study.analyses[i])}
        return cls(
            frozenset(name for name in study.surrogates if name in asked | set(only)), frozenset(analyses)
        )


def _models(entry: AnalysisEntry) -> list[str]:
    """Return the names of the models that an analysis asks."""
    return [name for name in (entry.value.model, getattr(entry.value, "compare_with", None)) if name]


@dataclass(frozen=True)
class Fitted:
    """A surrogate and the key of all that it came from."""

    surrogate: "Surrogate"
    key: str


def _surrogates(campaign: Campaign, index: Index, wanted: Wanted, listener: Listener) -> dict[str, Fitted]:
    """Fit the study's surrogates, or load those that are there."""
    study = campaign.study
    known, index.surrogates = index.surrogates, {}
    if not study.surrogates:
        return {}
    try:
        data = campaign.training_data()
    except StudyError as error:
        index.failures.append(str(error))
        return {}
    from tensegra.surrogate import RegimeData, campaign_runs

    folder = campaign.folder / SURROGATES
    folder.mkdir(exist_ok=True)
    fitted: dict[str, Fitted] = {}
    for done, (name, entry) in enumerate(study.surrogates.items()):
        listener("surrogates", done, len(study.surrogates), name)
        runs = campaign_runs(campaign) if entry.kind == "piecewise" else data
        learnt = [runs.X.tolist(), data.Y.tolist()]
        if isinstance(runs, RegimeData):
            learnt.append(runs.labels.tolist())
        key = key_of("surrogate", entry.written(), study.seed, *learnt)
        is_known = known.get(name, {}).get("key") == key
        surrogate = _kept(folder / f"{name}.tg") if is_known else None
        if surrogate is None and name not in wanted.surrogates:
            continue
        if surrogate is None:
            try:
                surrogate = _fit(runs, entry, study.seed, folder / name)
            except Exception as error:  # noqa: BLE001 - the others are to be had, whatever this one met
                index.failures.append(_told(f"surrogates.{name}", error))
                continue
        fitted[name] = Fitted(surrogate, key)
        index.surrogates[name] = {"key": key}
    index.write(campaign.folder)
    listener("surrogates", len(study.surrogates), len(study.surrogates))
    return fitted


def _kept(path: Path) -> "Surrogate | None":
    """Return the surrogate in a file; None if there is none, or it is damaged and has to be made anew."""
    from tensegra.surrogate import load

    try:
        return load(path)
    except StudyError:
        return None


def _fit(data: "TrainingData | RegimeData", entry: SurrogateEntry, seed: int, stem: Path) -> "Surrogate":
    """Fit a surrogate, keep the standing runs that it did not see, and save both."""
    import pandas as pd

    from tensegra.surrogate import fit

    if entry.outputs is not None:
        data = data.select_outputs(entry.outputs)
    order = np.random.default_rng(seed).permutation(data.n_points)
    n_held = entry.validation_size or round(HELD_OUT * data.n_points)
    if n_held > data.n_points - 2:
        raise StudyError.at(
            f"surrogates.{stem.name}.validation_size", n_held, f"fewer than {data.n_points} runs"
        )
    held, rest = data.rows(np.sort(order[:n_held])), data.rows(np.sort(order[n_held:]))
    surrogate = fit(
        rest, entry.kind, training_size=entry.training_size, validation=held, seed=seed, **entry.options
    )
    seen = held if isinstance(held, TrainingData) else held.runs
    columns = dict(zip(seen.input_names, seen.X.T, strict=True)) | dict(
        zip(seen.output_names, seen.Y.T, strict=True)
    )
    predicted = surrogate.predict(seen.X)
    std = surrogate.predict(seen.X, return_std=True)[1] if surrogate.has_std else None
    for k, output in enumerate(seen.output_names):
        columns[f"{output}_predicted"] = predicted[:, k]
        if std is not None:
            columns[f"{output}_std"] = std[:, k]
    _write_table(pd.DataFrame(columns), stem.with_name(f"{stem.name}.parquet"))
    surrogate.save(stem.with_name(f"{stem.name}.tg"))
    return surrogate


def _told(place: str, error: Exception) -> str:
    """Return what has failed in one line; what nobody foresaw with the name of its class."""
    logger.debug("%s", place, exc_info=error)
    text = " ".join(str(error).split())
    text = text if isinstance(error, StudyError) else f"{type(error).__name__} {text}".strip()
    return text if text.startswith(place) else f"{place}: {text}"


def _analyses(
    campaign: Campaign, surrogates: Mapping[str, Fitted], index: Index, wanted: Wanted, listener: Listener
) -> None:
    """Carry out the study's analyses, or keep those that are there."""
    study = campaign.study
    known, index.analyses = index.analyses, []
    for number, entry in enumerate(study.analyses):
        asked = _models(entry)
        missing = [name for name in asked if name not in surrogates and name != TRUTH]
        if missing and number not in wanted.analyses:
            continue
        if missing:
            index.failures.append(f"analyses[{number}]: there is no surrogate {missing[0]!r} to ask")
            continue
        keys = [surrogates[name].key for name in asked if name in surrogates]
        key = key_of(entry.kind, entry.written(), study.seed, study.fingerprint, keys)
        there = [record for record in known if record["key"] == key and record["entry"] == number]
        if there and all(
            (campaign.folder / ANALYSES / f"{record['stem']}.json").is_file() for record in there
        ):
            index.analyses += there
        elif number in wanted.analyses:
            try:
                index.analyses += _analyse(campaign, number, entry, surrogates, key, listener)
            except Exception as error:  # noqa: BLE001 - the others are to be had, whatever this one met
                index.failures.append(_told(f"analyses[{number}]", error))
        index.write(campaign.folder)
    index.failures += [
        f"{' by '.join(filter(None, (record['name'], record['method'])))}: {record['failure']}"
        for record in index.analyses
        if record.get("failure")
    ]


def _analyse(
    campaign: Campaign,
    number: int,
    entry: AnalysisEntry,
    surrogates: Mapping[str, Fitted],
    key: str,
    listener: Listener,
) -> list[dict[str, Any]]:
    """Carry out one entry, save its results, and return their records."""
    from tensegra.analysis import run_analyses

    asked = replace(campaign.study, analyses=(entry,))
    models = {name: fitted.surrogate for name, fitted in surrogates.items()}
    began = time.perf_counter()
    results = run_analyses(asked, campaign, models, listener)
    seconds = time.perf_counter() - began
    records = []
    for result in results:
        method = str(getattr(result, "method", "")) if entry.kind == "optimisation" else ""
        stem = "-".join(filter(None, (f"{number + 1:02d}", entry.kind, method)))
        _save(result, campaign.folder / ANALYSES / stem)
        record = {
            "kind": entry.kind,
            "name": title_of(entry, number),
            "method": method,
            "entry": number,
            "stem": stem,
            "key": key,
            "seconds": getattr(result, "seconds", seconds),
            "failure": "" if getattr(result, "success", True) else str(getattr(result, "reason", "failed")),
        }
        records.append(record)
    return records


def _save(result: Any, stem: Path) -> None:  # noqa: ANN401 - any result of an analysis
    import pandas as pd

    content = result.to_dict()
    trace = content.pop("trace", None)
    write_json(stem.with_name(f"{stem.name}.json"), content)
    _write_table(pd.DataFrame(result.table()), stem.with_name(f"{stem.name}.parquet"))
    if trace is not None:
        _write_table(_trace_frame(result), stem.with_name(f"{stem.name}.trace.parquet"))


def _write_table(frame: "pd.DataFrame", path: Path) -> None:
    with replacing(path, StudyError) as file:
        frame.to_parquet(file, index=False)


def _trace_frame(result: Any) -> Any:  # noqa: ANN401 - an Optimum; a DataFrame
    """Return every evaluation of a search as a row."""
    import pandas as pd

    trace = result.trace
    columns = {"evaluation": trace.evaluation, "start": trace.start}
    columns |= dict(zip(result.input_names, trace.x.T, strict=True))
    columns |= dict(zip(result.outputs, trace.outputs.T, strict=True))
    columns |= {"objective": trace.objective, "feasible": trace.feasible, "best": trace.best}
    return pd.DataFrame(columns)


def versions() -> dict[str, str]:
    """Return the versions of what results depend on, by package."""
    return {package: _version(package) for package in PACKAGES}


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"
