"""The study file, ``tensegra/study/1``: all its keys.

Read by `tensegra.study.reading.read_study`; the entries are described beside the code that gives them
their meaning.
"""

from typing import Annotated, Any, Literal

from pydantic import Field, Strict

from tensegra.study.analyses import AnalysisEntry, SurrogateEntry
from tensegra.study.entry import Entry, Flag, Identifier, Number
from tensegra.study.outputs import OutputEntry
from tensegra.study.sampling import Design
from tensegra.study.selection import SelectionEntry
from tensegra.study.solver import SolverEntry
from tensegra.study.variables import VariableEntry

__all__ = ["SCHEMA", "StudyFile"]

SCHEMA = "tensegra/study/1"


class StudyFile(Entry):
    """A study as its file holds it.

    Parameters
    ----------
    structure
        A structure file relative to the study's, ``library:`` and the name of a built-in structure, or
        the content of a structure file itself.
    changes
        To the structure, before anything else; the keys of a structure file.
    seed
        Of everything that is random in the study.
    variables, correlation
        What varies; a matrix of rank correlations in the order of the variables.
    outputs
        What is wanted of each run.
    solver
        How its path is followed.
    derivatives
        Whether to store the derivatives of the outputs by the variables, too.
    design
        Which points are run.
    selection, surrogates, analyses
        What is made of the runs.
    """

    schema_: Literal["tensegra/study/1"] = Field(alias="schema")
    name: Annotated[str, Field(min_length=1)] | None = None
    description: str = ""
    structure: Annotated[str, Field(min_length=1)] | dict[str, Any]
    changes: dict[str, Any] = Field(default_factory=dict)
    seed: Annotated[int, Strict(), Field(ge=0)] = 0
    variables: dict[Identifier, VariableEntry] = Field(min_length=1)
    correlation: tuple[tuple[Number, ...], ...] | None = None
    outputs: dict[Identifier, OutputEntry] = Field(min_length=1)
    solver: SolverEntry = SolverEntry()
    derivatives: Flag = False
    design: Design
    selection: SelectionEntry = SelectionEntry()
    surrogates: dict[Identifier, SurrogateEntry] = Field(default_factory=dict)
    analyses: tuple[AnalysisEntry, ...] = ()
