"""The kinds of surrogate there are; a new one is entered here and nowhere else."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from tensegra.errors import StudyError
from tensegra.surrogate import chaos, field, gpr, network, piecewise
from tensegra.surrogate.problem import Model

__all__ = ["KINDS", "Kind", "kind_of"]


@dataclass(frozen=True)
class Kind:
    """How a kind is trained, and the model that it yields."""

    train: Callable[..., Model]
    model: type[Model]


KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "gpr": Kind(gpr.train, gpr.GaussianProcess),
        "nn": Kind(network.train, network.Network),
        "pce": Kind(chaos.train, chaos.Chaos),
        "field": Kind(field.train, field.Field),
        "piecewise": Kind(piecewise.train, piecewise.Piecewise),
    }
)


def kind_of(name: str) -> Kind:
    """Return the kind of a name.

    Raises
    ------
    StudyError
        If there is none of this name.
    """
    if name not in KINDS:
        raise StudyError.at("kind of surrogate", name, f"one of {', '.join(KINDS)}", candidates=KINDS)
    return KINDS[name]
