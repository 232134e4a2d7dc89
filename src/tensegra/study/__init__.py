"""study: what is varied and wanted, how it is sampled, and the campaign of all its runs."""

from tensegra.files import replacing
from tensegra.study.analyses import AnalysisEntry, SurrogateEntry
from tensegra.study.campaign import Campaign, CampaignState, open_campaign
from tensegra.study.cost import Probe, probe
from tensegra.study.data import TrainingData
from tensegra.study.distributions import Distribution, as_distribution
from tensegra.study.driver import pending_points
from tensegra.study.evaluate import Runs, evaluate
from tensegra.study.executors import Executor, InProcess
from tensegra.study.outputs import Output
from tensegra.study.points import write_points
from tensegra.study.reading import parse_study, read_study
from tensegra.study.sampling import unit_points
from tensegra.study.schema import StudyFile
from tensegra.study.selection import Selection, select
from tensegra.study.solver import SolverEntry
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
    "Probe",
    "Runs",
    "Selection",
    "SolverEntry",
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
    "pending_points",
    "probe",
    "read_study",
    "replacing",
    "select",
    "unit_points",
    "write_points",
]
