"""Figs. 15 and 16: the optimum on the beam and on a gripper of four."""

from tensegra_paper.chapters.gripper.chapter import gripper

__all__ = ["gripper"]
