"""What we learn: surrogates fitted to the runs of a campaign."""

from tensegra.surrogate.adaptive import Learnt, learn
from tensegra.surrogate.auto import Choice, choose
from tensegra.surrogate.batches import field_arrays, field_runs
from tensegra.surrogate.fit import fit
from tensegra.surrogate.kinds import KINDS
from tensegra.surrogate.regimes import RegimeData, campaign_runs, regime_labels
from tensegra.surrogate.storage import load
from tensegra.surrogate.surrogate import OutsideBoxWarning, Surrogate
from tensegra.surrogate.threads import one_thread
from tensegra.surrogate.validation import Validation, measure

__all__ = [
    "KINDS",
    "Choice",
    "Learnt",
    "OutsideBoxWarning",
    "RegimeData",
    "Surrogate",
    "Validation",
    "campaign_runs",
    "choose",
    "field_arrays",
    "field_runs",
    "fit",
    "learn",
    "load",
    "measure",
    "one_thread",
    "regime_labels",
]
