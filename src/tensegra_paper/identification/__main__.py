"""``python -m tensegra_paper.identification``: search, or go on; write the beam, counts and fronts."""

import argparse
import sys
from pathlib import Path

import tensegra as tg
from tensegra_paper.identification.front import fronts
from tensegra_paper.identification.outcome import beam_of, page
from tensegra_paper.identification.records import Records
from tensegra_paper.identification.responses import Effort
from tensegra_paper.identification.search import Plan, search
from tensegra_paper.identification.tally import tally

BESIDE = ("paper_beam", "paper_beam_slender")


def main(arguments: list[str] | None = None) -> int:
    """Run the search.

    Parameters
    ----------
    arguments
        Of the command line; those of the process where left out.

    Returns
    -------
    int
        0 done, 1 where no beam was found that stands; the parser exits with 2 itself.
    """
    parser = argparse.ArgumentParser("python -m tensegra_paper.identification", description=__doc__)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER", help="records and results"
    )
    parser.add_argument(
        "--scale", type=_share, default=1.0, help="share of the full numbers of candidates, in (0, 1]"
    )
    parser.add_argument("--seed", type=int, default=Plan.seed)
    chosen = parser.parse_args(arguments)
    folder: Path = chosen.output
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"argument -o/--output: {folder}: {error.strerror}")
    plan = Plan(seed=chosen.seed).scaled(chosen.scale)
    best = search(folder, plan, _tell)
    if not best:
        _tell("no beam of the family was found that stands; a larger --scale tries more")
        return 1
    records, effort = Records(folder / "records.jsonl"), Effort()
    found = fronts(records, plan.n_front, plan.seed, effort, _tell)
    structure = beam_of(best[0])
    tg.write_structure(structure, folder / "paper_beam_identified.json")
    beams = [tally(name, getattr(tg.library, name)()) for name in BESIDE]
    text = page([*beams, tally(structure.name, structure)], best, records, found, plan)
    (folder / "identified.md").write_text(text, encoding="utf-8")
    sys.stdout.write(text)
    return 0


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number above 0, at most 1")
    return value


def _tell(line: str) -> None:
    sys.stderr.write(line + "\n")


if __name__ == "__main__":
    sys.exit(main())
