"""Figs. 13 and 19: what the displacements depend on."""

from tensegra_paper.chapters.indices.chapter import indices

__all__ = ["indices"]
