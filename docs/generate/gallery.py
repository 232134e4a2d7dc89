"""The gallery: built-in structures, each solved, drawn, and written to a file to download."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

import tensegra as tg
from tensegra.report.figures import structure_figure, svg
from tensegra.structure import Structure, library

__all__ = ["pages"]

SHOWN: Mapping[str, tuple[Callable[[], Structure], Mapping[str, float], str]] = {
    "prism": (library.prism, {}, "Three struts that do not touch, the smallest tensegrity in space."),
    "tower": (
        lambda: library.tower(5, clustered="full"),
        {"chain0": 0.02},
        "Five prisms of four struts. Four cables run from the ground to the top; shortening one bends it.",
    ),
    "paper-beam": (
        library.paper_beam,
        {"A14": 0.10, "A23": 0.10},
        "Four clustered cables bend twelve struts upwards: the beam of the paper that is reproduced here.",
    ),
    "gripper": (
        library.gripper,
        {"A14": 0.10, "A23": 0.10},
        "Four such beams on a circle, closed by the same actuators.",
    ),
    "d-bar": (
        library.d_bar,
        {},
        "Two struts cross without touching; a clustered cable runs over a pulley at the top.",
    ),
    "levy-dome": (
        library.levy_dome,
        {},
        "A dome of cables and upright struts inside a held ring; its two hoops are clustered.",
    ),
    "grid": (library.grid, {}, "A net of cables on a saddle, prestressed and held along its border."),
    "hanging-chain": (
        library.hanging_chain,
        {},
        "A chain under its own weight, which takes the form of a catenary.",
    ),
}
"""By name: the structure, its actuation, and a sentence."""

HEAD = """\
# Gallery

Eight structures of the library, solved and drawn by the build of this page. Struts are black, cables blue,
clustered cables red; grey is where it stood before. Each file is read by `tensegra check`, and
`tensegra new --from library:NAME` writes one with remarks.
"""


def pages(folder: Path) -> dict[str, str]:
    """Return the page of the gallery; draw its pictures and write its files."""
    (folder / "gallery").mkdir(exist_ok=True)
    parts = [HEAD]
    for name, (build, actuation, sentence) in SHOWN.items():
        structure = build()
        path = tg.solve_path(structure, actuation).raise_for_status()
        before = path.stages[-1].nodes if actuation else None
        drawn = structure_figure(structure, path.final.nodes, reference=before)
        (folder / "gallery" / f"{name}.svg").write_bytes(svg(drawn))
        tg.write_structure(structure, folder / "gallery" / f"{name}.yaml")
        asked = "".join(f" -a {actuator}={value:g}" for actuator, value in actuation.items())
        largest = np.abs(path.final.tensions).max()
        parts.append(
            f"## {name}\n\n{sentence}\n\n![{structure.name}]({f'gallery/{name}.svg'})\n\n"
            f"{structure!r}\n\nLargest force {largest:.4g} {structure.units.force}, lowest eigenvalue "
            f"{path.final.lowest_eigenvalue:.4g} {structure.units.force}/{structure.units.length}; it is "
            f"`{path.status}`.\n\n{{download}}`{name}.yaml <gallery/{name}.yaml>`: "
            f"`tensegra solve {name}.yaml{asked}`\n"
        )
    return {"gallery.md": "\n".join(parts)}
