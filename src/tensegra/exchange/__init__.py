"""exchange: structures, paths and runs, from and to the files of other programs."""

from tensegra.exchange.exchange import read_structure, save
from tensegra.exchange.formats import FORMATS, Format

__all__ = ["FORMATS", "Format", "read_structure", "save"]
