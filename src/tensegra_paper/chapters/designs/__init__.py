"""Figs. 8 and 9: the design of five inputs, and the temperatures."""

from tensegra_paper.chapters.designs.chapter import designs

__all__ = ["designs"]
