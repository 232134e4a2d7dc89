"""Fig. 6: how random actuations come out."""

from tensegra_paper.chapters.outcomes.chapter import outcomes

__all__ = ["outcomes"]
