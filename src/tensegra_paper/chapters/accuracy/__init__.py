"""Figs. 10 and 11: the surrogates against runs that they have not seen."""

from tensegra_paper.chapters.accuracy.chapter import accuracy

__all__ = ["accuracy"]
