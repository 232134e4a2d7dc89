"""How large a reproduction is, of which beam, and where what it has solved is kept."""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from hashlib import sha256
from math import ceil, log2
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra import StudyError
from tensegra.mechanics import PathSettings
from tensegra.report import key_of
from tensegra.structure import Structure, apply_changes, library
from tensegra.study import replacing
from tensegra_paper.beam_model import BeamRuns, solve_beam

__all__ = ["STRUCTURES", "Setting"]

Array: TypeAlias = NDArray[np.float64]

STRUCTURES = ("paper_beam", "paper_beam_slender", "paper_beam_identified")

KEPT = 2
"""Number of what is kept of a run; another is not read."""

BLOCK = 8192
"""Runs that are solved and kept together: what an interruption costs at most."""

SECONDS_BETWEEN_LINES = 10.0


def _silent(line: str, /) -> None:
    """Do nothing with what is told."""


@dataclass(frozen=True)
class Setting:
    """What all chapters of a reproduction share.

    Attributes
    ----------
    folder
        Where results are kept; what is there already is not solved again.
    structure_name
        One of `STRUCTURES`.
    scale
        Share of the publication's numbers of runs, in (0, 1].
    seed
        From which all random choices come.
    threads
        One a core where None.
    tell
        Told of the progress, a line at a time.
    spared
        Seconds that the blocks of runs took which were solved before this process, by their keys.

    Raises
    ------
    StudyError
        For a beam that there is not, or a scale out of range.
    """

    folder: Path
    structure_name: str = "paper_beam"
    scale: float = 1.0
    seed: int = 1
    threads: int | None = None
    tell: Callable[[str], None] = field(default=_silent, repr=False)
    spared: dict[str, float] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.structure_name not in STRUCTURES:
            expected = f"{', '.join(STRUCTURES[:-1])} or {STRUCTURES[-1]}"
            raise StudyError.at("--structure", self.structure_name, expected, candidates=STRUCTURES)
        if not 0.0 < self.scale <= 1.0:
            raise StudyError.at("--scale", self.scale, "a number above 0, at most 1")

    @cached_property
    def structure(self) -> Structure:
        """The beam, under gravity."""
        beam: Structure = getattr(library, self.structure_name)()
        return beam

    @cached_property
    def without_gravity(self) -> Structure:
        """The beam without its weight, as the publication has it where actuations reach 30 %."""
        return apply_changes(self.structure, {"gravity": [0, 0, 0]})

    def count(self, full: int, least: int = 1) -> int:
        """Return a number of runs to scale, between `least` and the full number.

        Examples
        --------
        >>> small = Setting(Path("."), scale=0.01)
        >>> small.count(100_000), small.count(10_000, least=200), small.count(50, least=200)
        (1000, 200, 50)
        """
        return min(full, max(least, round(self.scale * full)))

    def power_of_two(self, full: int, least: int = 1) -> int:
        """Return the power of two nearest to a number of runs to scale, not below `least`.

        Examples
        --------
        >>> Setting(Path(".")).power_of_two(10_000), Setting(Path("."), scale=0.01).power_of_two(10_000, 64)
        (8192, 128)
        """
        return int(2 ** max(round(log2(max(1.0, self.scale * full))), ceil(log2(least))))

    def seed_of(self, name: str) -> int:
        """Return the seed of one random choice, independent of all others.

        Examples
        --------
        >>> setting = Setting(Path("."))
        >>> setting.seed_of("a") == setting.seed_of("a") != setting.seed_of("b")
        True
        """
        return int.from_bytes(sha256(f"{self.seed}:{name}".encode()).digest()[:4])

    def runs(
        self,
        name: str,
        structure: Structure,
        inputs: Mapping[str, Array],
        settings: PathSettings | None = None,
    ) -> BeamRuns:
        """Solve runs block by block, each kept on the disk as soon as it is done.

        Parameters
        ----------
        name
            Of the design, for the reader and the files.
        structure, inputs, settings
            As for `solve_beam`.

        Returns
        -------
        BeamRuns
            In the order of the inputs; `seconds` is what solving took, also where it was done before.

        Raises
        ------
        StudyError
            If a block cannot be written.
        """
        settings = settings or PathSettings()
        n_runs = len(next(iter(inputs.values())))
        blocks: list[BeamRuns] = []
        began, told, solved = time.monotonic(), time.monotonic(), 0
        for first in range(0, n_runs, BLOCK):
            part = {key: np.asarray(column[first : first + BLOCK]) for key, column in inputs.items()}
            key = key_of(
                structure.fingerprint,
                {key: sha256(column.tobytes()).hexdigest() for key, column in part.items()},
                asdict(settings),
                KEPT,
            )
            before = self._read(name, key)
            if before is not None:
                blocks.append(BeamRuns.of_arrays(before))
                self.spared.setdefault(key, blocks[-1].seconds)
                continue
            block = solve_beam(structure, part, settings, threads=self.threads)
            self._write(name, key, block.to_arrays())
            self.spared[key] = 0.0
            blocks.append(block)
            solved += block.n_runs
            now, done = time.monotonic(), first + block.n_runs
            if now - told > SECONDS_BETWEEN_LINES and done < n_runs:
                told, rate = now, solved / (now - began)
                left = (n_runs - done) / rate
                self.tell(f"{name}: {done} of {n_runs} runs, {rate:.3g}/s, {left:.0f} s left")
        return BeamRuns.joined(blocks)

    def kept(
        self, name: str, parts: object, make: Callable[[], Mapping[str, NDArray[Any]]]
    ) -> dict[str, NDArray[Any]]:
        """Return arrays that `make` makes, or made before from the same `parts`.

        Parameters
        ----------
        name
            For the files.
        parts
            Plain values on which the result depends, besides the structure, the scale and the seed.
        make
            Makes the arrays; numbers are arrays of no dimension.

        Examples
        --------
        >>> from tempfile import TemporaryDirectory
        >>> with TemporaryDirectory() as folder:
        ...     setting = Setting(Path(folder))
        ...     first = setting.kept("one", [1], lambda: {"x": np.array(1.0)})
        ...     again = setting.kept("one", [1], lambda: {"x": np.array(2.0)})
        >>> float(again["x"])
        1.0
        """
        key = key_of(self.structure.fingerprint, self.scale, self.seed, parts)
        before = self._read(name, key)
        if before is None:
            before = {title: np.asarray(array) for title, array in make().items()}
            self._write(name, key, before)
        return before

    def _path(self, name: str, key: str) -> Path:
        return self.folder / "runs" / f"{name}-{key[:16]}.npz"

    def _read(self, name: str, key: str) -> dict[str, NDArray[Any]] | None:
        path = self._path(name, key)
        if not path.is_file():
            return None
        with np.load(path, allow_pickle=False) as kept:
            return {title: kept[title] for title in kept.files}

    def _write(self, name: str, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        path = self._path(name, key)
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            np.savez(file, **dict(arrays))  # type: ignore[arg-type]  # the stub takes them for allow_pickle
