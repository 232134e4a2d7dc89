"""The pages that the build writes: from the schemas, the program itself, its tests and its figures."""

from pathlib import Path

from generate import benchmarks, commands, formats, gallery, messages, pictures, verification

__all__ = ["write_all"]


def write_all(folder: Path) -> None:
    """Write all generated pages and pictures into a folder."""
    folder.mkdir(exist_ok=True)
    for part in (formats, commands, messages, benchmarks, pictures, gallery, verification):
        for name, text in part.pages(folder).items():
            page = folder / name
            page.parent.mkdir(parents=True, exist_ok=True)
            # A page that has not changed keeps its date, and need not be built again.
            if not page.exists() or page.read_text(encoding="utf-8") != text:
                page.write_text(text, encoding="utf-8", newline="\n")
