"""benchmark: how fast it is, beside the machine's limit and other programs."""

from tensegra.benchmark.benchmark import FULL, QUICK, Benchmark, Sizes, measure, to_markdown

__all__ = ["FULL", "QUICK", "Benchmark", "Sizes", "measure", "to_markdown"]
