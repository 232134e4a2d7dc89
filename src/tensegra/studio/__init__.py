"""The studio: a structure under one's hand, on a page."""

from tensegra.studio.server import serve
from tensegra.studio.source import open_source

__all__ = ["open_source", "serve"]
