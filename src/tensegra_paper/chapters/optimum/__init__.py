"""Figs. 14, 17 and 18 and Eq. 12: the optimisation."""

from tensegra_paper.chapters.optimum.chapter import optimum, well_posed_optimum

__all__ = ["optimum", "well_posed_optimum"]
