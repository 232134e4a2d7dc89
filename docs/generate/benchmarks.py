"""The benchmarks' page: `benchmarks/README.md`, with its links turned to this site's."""

from pathlib import Path

__all__ = ["pages"]


def pages(folder: Path) -> dict[str, str]:
    """Return the page of benchmarks."""
    text = (folder.parents[1] / "benchmarks" / "README.md").read_text(encoding="utf-8")
    return {"benchmarks.md": text.replace("](../docs/", "](../")}
