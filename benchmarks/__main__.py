"""Measure how fast this machine solves: what `python -m benchmarks` does."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.solver.everything import FULL, QUICK, Benchmark, measure, to_markdown
from tensegra.progress import progress
from tensegra.terminal import print_json, print_line, print_table


def main(
    quick: Annotated[bool, typer.Option("--quick", help="Smaller sizes and fewer repetitions.")] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the tables to a Markdown file.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Measure how fast this machine solves, beside its limit and other programs."""
    if output is not None and not output.parent.is_dir():
        # Found out before the minutes of measuring, not after.
        sys.stderr.write(f"benchmarks: error: {output.parent}: no such folder\n")
        raise typer.Exit(2)
    with progress() as listener:
        benchmark = measure(QUICK if quick else FULL, listener)
    if output is not None:
        output.write_text(to_markdown(benchmark), encoding="utf-8")
    show(benchmark, as_json=as_json)


def show(benchmark: Benchmark, *, as_json: bool = False) -> None:
    """Print what a machine was measured to do."""
    if as_json:
        print_json(benchmark.to_dict())
        return
    print_line(f"{benchmark.machine}.")
    print_line()
    for table in benchmark.tables():
        print_table(table)


app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(main)

if __name__ == "__main__":
    app(prog_name="python -m benchmarks")
