"""The viewer: a structure, a path or many runs in space, on a page, in a report and in a notebook."""

from tensegra.viewer.page import panel
from tensegra.viewer.scene import scene

__all__ = ["panel", "scene"]
