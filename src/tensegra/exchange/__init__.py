"""exchange: structures, paths and runs, from and to the files of other programs."""

from tensegra.exchange.exchange import read_structure, save

__all__ = ["read_structure", "save"]
