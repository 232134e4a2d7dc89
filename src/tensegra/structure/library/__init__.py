"""library: structures to start from, each with its source."""

from tensegra.structure.library.beam import paper_beam, paper_beam_identified, paper_beam_slender
from tensegra.structure.library.d_bar import d_bar
from tensegra.structure.library.grid import grid
from tensegra.structure.library.gripper import gripper
from tensegra.structure.library.hanging_chain import hanging_chain
from tensegra.structure.library.levy_dome import levy_dome
from tensegra.structure.library.prism import prism
from tensegra.structure.library.tower import tower
from tensegra.structure.library.von_mises_truss import von_mises_truss

__all__ = [
    "d_bar",
    "grid",
    "gripper",
    "hanging_chain",
    "levy_dome",
    "paper_beam",
    "paper_beam_identified",
    "paper_beam_slender",
    "prism",
    "tower",
    "von_mises_truss",
]
