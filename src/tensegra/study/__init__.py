"""study: what is varied and wanted, how it is sampled, and the campaign of all its runs."""

from tensegra.study.analyses import AnalysisEntry, SurrogateEntry
from tensegra.study.campaign import Campaign, CampaignState, open_campaign
from tensegra.study.data import TrainingData
from tensegra.study.distributions import Distribution, as_distribution
from tensegra.study.evaluate import Runs, evaluate
from tensegra.study.executors import Executor, InProcess, Processes
from tensegra.study.outputs import Output
from tensegra.study.points import write_points
from tensegra.study.reading import parse_study, read_study
from tensegra.study.sampling import unit_points
from tensegra.study.schema import StudyFile
from tensegra.study.selection import Selection, select
from tensegra.study.space import Space
from tensegra.study.study import Study, design_points
from tensegra.study.variables import Variable

__all__ = [
    "AnalysisEntry",
    "Campaign",
    "CampaignState",
    "Distribution",
    "Executor",
    "InProcess",
    "Output",
    "Processes",
    "Runs",
    "Selection",
    "Space",
    "Study",
    "StudyFile",
    "SurrogateEntry",
    "TrainingData",
    "Variable",
    "as_distribution",
    "design_points",
    "evaluate",
    "open_campaign",
    "parse_study",
    "read_study",
    "select",
    "unit_points",
    "write_points",
]
