"""The study file, ``tensegra/study/1``: all its keys.

Read by `tensegra.study.reading.read_study`; the entries are described beside the code that gives them
their meaning.
"""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict

from tensegra.study.analyses import AnalysisEntry, SurrogateEntry
from tensegra.study.entry import Entry, Examples, Flag, Identifier, Number
from tensegra.study.outputs import OutputEntry
from tensegra.study.sampling import Design
from tensegra.study.selection import SelectionEntry
from tensegra.study.solver import SolverEntry
from tensegra.study.variables import VariableEntry

__all__ = ["SCHEMA", "StudyFile"]

SCHEMA = "tensegra/study/1"


class StudyFile(Entry):
    """A study as its file holds it."""

    examples: ClassVar[Examples] = (
        {
            "schema": "tensegra/study/1",
            "name": "tip",
            "description": "How far the tip scatters.",
            "structure": "library:paper_beam",
            "changes": {"gravity": [0, 0, 0]},
            "seed": 1,
            "variables": {
                "A14": {"actuator": "A14", "distribution": {"uniform": [0.09, 0.1]}},
                "A23": {"actuator": "A23", "distribution": {"uniform": [0.09, 0.1]}},
            },
            "correlation": [[1, 0.5], [0.5, 1]],
            "outputs": {"w": {"displacement": "z", "nodes": [18, 23]}},
            "solver": {"policy": "stop"},
            "derivatives": True,
            "design": {"sampler": "sobol", "sizes": 256},
            "selection": {"method": "certificate"},
            "surrogates": {"poly": {"kind": "pce"}},
            "analyses": [{"propagation": {"model": "poly"}}],
        },
    )

    schema_: Literal["tensegra/study/1"] = Field(alias="schema")
    """Format of the file."""
    name: Annotated[str, Field(min_length=1)] | None = None
    """Name of the study, for people; the file's name if left out."""
    description: str = ""
    """What the study asks, for people."""
    structure: Annotated[str, Field(min_length=1)] | dict[str, Any]
    """Structure file relative to the study's, `library:` and the name of a built-in structure, or the content
    of a structure file itself."""
    changes: dict[str, Any] = Field(default_factory=dict)
    """Changes to the structure before anything else: keys of a structure file, null to remove one."""
    seed: Annotated[int, Strict(), Field(ge=0)] = 0
    """Seed of everything that is random in the study. [1]"""
    variables: dict[Identifier, VariableEntry] = Field(min_length=1)
    """What varies, by name: a name of letters, digits and underscores."""
    correlation: tuple[tuple[Number, ...], ...] | None = None
    """Rank correlations of the variables, a matrix in their order: a Gaussian copula. [1]"""
    outputs: dict[Identifier, OutputEntry] = Field(min_length=1)
    """What is wanted of each run, by name."""
    solver: SolverEntry = SolverEntry()
    """How the paths of all runs are followed."""
    derivatives: Flag = False
    """Whether to store the derivatives of the outputs by the variables, too."""
    design: Design
    """Which points are run."""
    selection: SelectionEntry = SelectionEntry()
    """Which runs surrogates learn from."""
    surrogates: dict[Identifier, SurrogateEntry] = Field(default_factory=dict)
    """Surrogates to fit, by name."""
    analyses: tuple[AnalysisEntry, ...] = ()
    """Questions to ask, each a mapping with one key, the kind of analysis."""
