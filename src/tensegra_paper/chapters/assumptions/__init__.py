"""What the paper does not print, what was taken for it, and what that changes."""

from tensegra_paper.chapters.assumptions.chapter import assumptions

__all__ = ["assumptions"]
