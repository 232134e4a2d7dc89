"""What the server was started with: a structure, or a campaign with its surrogates."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from tensegra.report.references import structure_from
from tensegra.report.results import open_results
from tensegra.structure import Structure
from tensegra.studio.knobs import Knob, knobs_of_structure, knobs_of_study
from tensegra.study import Study, open_campaign

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

__all__ = ["Source", "open_source"]


@dataclass(frozen=True, eq=False)
class Source:
    """What is shown; nothing that a page asks for is opened beside it.

    Attributes
    ----------
    reference
        As the user typed it.
    structure
        The structure, or that of the study.
    study, surrogates
        Of a campaign; None and none for a structure.
    """

    reference: str
    structure: Structure
    study: Study | None = None
    surrogates: "dict[str, Surrogate]" = field(default_factory=dict)

    def knobs(self) -> dict[str, Knob]:
        """Return a page's own knobs."""
        found = (
            knobs_of_structure(self.structure) if self.study is None else knobs_of_study(self.study.variables)
        )
        return {knob.key: knob for knob in found}


def open_source(reference: str) -> Source:
    """Open a structure file, ``library:NAME`` or the folder of a campaign.

    Raises
    ------
    TensegraError
        It cannot be read.
    """
    if not Path(reference).is_dir():
        return Source(reference, structure_from(reference))
    campaign = open_campaign(reference)
    stored = open_results(campaign).surrogates
    surrogates = {name: found.surrogate for name, found in stored.items()}
    return Source(reference, campaign.study.structure, campaign.study, surrogates)
