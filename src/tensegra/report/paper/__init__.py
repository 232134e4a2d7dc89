"""The publication's studies, made again with one command."""

from tensegra.report.paper.reproduction import Reproduction, reproduce

__all__ = ["Reproduction", "reproduce"]
