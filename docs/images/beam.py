"""Draw docs/images/beam.svg, the picture of the README: ``python docs/images/beam.py``."""

from pathlib import Path

import tensegra as tg
from tensegra.report.figures import structure_figure, svg


def main() -> None:
    """Draw the beam at 10 % actuation over the prestressed one."""
    beam = tg.library.paper_beam()
    path = tg.solve_path(beam, {"A14": 0.10, "A23": 0.10}).raise_for_status()
    drawn = structure_figure(beam, path.final.nodes, ["18", "23"], reference=path.stages[-1].nodes)
    Path(__file__).with_suffix(".svg").write_bytes(svg(drawn))


if __name__ == "__main__":
    main()
