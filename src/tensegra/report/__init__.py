"""What a reader sees: checks, tables, figures, and the report of a campaign."""

from tensegra.report.check import check_structure, check_study
from tensegra.report.pipeline import carry_out, versions
from tensegra.report.report import build_report, render, write_report
from tensegra.report.results import Results, key_of, open_results, write_json
from tensegra.report.tables import NOTHING, Table, labelled, number

__all__ = [
    "NOTHING",
    "Results",
    "Table",
    "build_report",
    "carry_out",
    "check_structure",
    "check_study",
    "key_of",
    "labelled",
    "number",
    "open_results",
    "render",
    "versions",
    "write_json",
    "write_report",
]
