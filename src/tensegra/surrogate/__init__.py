"""What we learn: surrogates fitted to the runs of a campaign."""

from tensegra.surrogate.fit import fit
from tensegra.surrogate.kinds import KINDS
from tensegra.surrogate.storage import load
from tensegra.surrogate.surrogate import OutsideBoxWarning, Surrogate
from tensegra.surrogate.validation import Validation

__all__ = ["KINDS", "OutsideBoxWarning", "Surrogate", "Validation", "fit", "load"]
