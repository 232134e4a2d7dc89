"""The paper's own chain, as printed, from its runs to its optimum."""

from tensegra_paper.chapters.chain.chapter import chain

__all__ = ["chain"]
