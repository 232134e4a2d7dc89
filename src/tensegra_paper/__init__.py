"""The studies of the source paper, made again with one command beside the printed values.

The package uses public names of `tensegra` alone, which never imports it.
"""

from tensegra_paper.making import reproduce
from tensegra_paper.reproduction import Reproduction

__all__ = ["Reproduction", "reproduce"]
