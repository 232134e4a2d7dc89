"""Fig. 12 and Table 2: uncertainty carried to the tip."""

from tensegra_paper.chapters.uncertainty.chapter import uncertainty

__all__ = ["uncertainty"]
