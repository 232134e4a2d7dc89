"""library: structures to start from."""

from tensegra.structure.library.beam import paper_beam, paper_beam_slender
from tensegra.structure.library.prism import prism

__all__ = ["paper_beam", "paper_beam_slender", "prism"]
