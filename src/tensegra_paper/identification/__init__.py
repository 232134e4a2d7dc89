"""The identified beam: a family with the printed counts, what is printed, and the search between them.

``python -m tensegra_paper.identification -o FOLDER`` searches, or goes on where it was.
"""

from tensegra_paper.identification.candidate import Candidate, reference
from tensegra_paper.identification.findings import FINDINGS, Finding
from tensegra_paper.identification.layout import Layout
from tensegra_paper.identification.search import Plan, Result, search
from tensegra_paper.identification.tally import Tally, tally

__all__ = [
    "FINDINGS",
    "Candidate",
    "Finding",
    "Layout",
    "Plan",
    "Result",
    "Tally",
    "reference",
    "search",
    "tally",
]
