"""Figs. 1 to 5: what the structure is, and its shapes."""

from tensegra_paper.chapters.shapes.chapter import shapes

__all__ = ["shapes"]
