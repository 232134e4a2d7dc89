"""What a reader sees: checks, tables, figures, and the report of a campaign."""

from tensegra.report.check import check_structure, check_study
from tensegra.report.pipeline import carry_out
from tensegra.report.report import build_report, write_report
from tensegra.report.results import Results, open_results
from tensegra.report.tables import Table

__all__ = [
    "Results",
    "Table",
    "build_report",
    "carry_out",
    "check_structure",
    "check_study",
    "open_results",
    "write_report",
]
