"""Fig. 20: which runs are learned from."""

from tensegra_paper.chapters.selection.chapter import selection

__all__ = ["selection"]
