"""The picture of the first page: a clustered beam, prestressed and bent."""

from pathlib import Path

import tensegra as tg
from tensegra.report.figures import structure_figure, svg

__all__ = ["pages"]


def pages(folder: Path) -> dict[str, str]:
    """Return no page, but draw the picture."""
    beam = tg.library.paper_beam()
    path = tg.solve_path(beam, {"A14": 0.10, "A23": 0.10}).raise_for_status()
    drawn = structure_figure(beam, path.final.nodes, ["18", "23"], reference=path.stages[-1].nodes)
    (folder / "beam.svg").write_bytes(svg(drawn))
    return {}
