"""A model inside a model: trained on its own part of the runs, in its own standardised variables."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.problem import Model, Problem, Scaling

__all__ = ["Part", "train_part"]

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Part:
    """A model of some kind, and the map from the variables of the model around it to its own.

    Parameters
    ----------
    kind
        Its kind.
    scaling
        Standardises once more what is standardised already.
    model
        The model.
    """

    kind: str
    scaling: Scaling
    model: Model

    def predict(self, Z: Array) -> Array:
        """Return the outputs."""
        inner = self.model.predict(self.scaling.inputs(Z))
        return self.scaling.output_shift + self.scaling.output_scale * inner

    def std(self, Z: Array) -> Array:
        """Return the standard deviations."""
        return self.scaling.output_scale * self.model.std(self.scaling.inputs(Z))

    def gradient(self, Z: Array) -> Array:
        """Return the derivatives."""
        slope = self.model.gradient(self.scaling.inputs(Z))
        return slope * self.scaling.output_scale[:, None] / self.scaling.input_scale

    def state(self, prefix: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays, their names beginning with `prefix`, and settings."""
        arrays, settings = self.model.state()
        arrays = arrays | {f"scaling_{name}": array for name, array in vars(self.scaling).items()}
        named = {f"{prefix}.{name}": array for name, array in arrays.items()}
        return named, {"kind": self.kind, "model": settings}

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any], prefix: str) -> Self:
        """Build the part that `state` was taken from."""
        from tensegra.surrogate.kinds import kind_of

        # By name, so that an array of another part is not read from the file.
        own = {
            name.removeprefix(f"{prefix}."): arrays[name] for name in arrays if name.startswith(f"{prefix}.")
        }
        scaling = Scaling(
            **{
                name.removeprefix("scaling_"): own.pop(name)
                for name in list(own)
                if name.startswith("scaling_")
            }
        )
        model = kind_of(settings["kind"]).model.from_state(own, settings["model"])
        return cls(settings["kind"], scaling, model)


def train_part(
    kind: str,
    problem: Problem,
    rng: np.random.Generator,
    options: Mapping[str, Any],
    *,
    own_box: bool = False,
    common_scale: bool = False,
) -> Part:
    """Train a model on a part of a problem.

    Parameters
    ----------
    kind, options
        What to train.
    problem
        The part: some of the points, or other outputs, of a standardised problem.
    rng
        Source of all that is random.
    own_box
        Whether the part fills its own corner of the box: it is then trained for the uniform law on that.
    common_scale
        Whether the sizes of the outputs, relative to each other, matter.
    """
    from tensegra.surrogate.kinds import kind_of

    scaling = Scaling.over(problem.Z, problem.T)
    if common_scale:
        scaling = replace(scaling, output_scale=np.full(problem.T.shape[1], scaling.output_scale.max()))
    outer = problem.scaling
    absolute = Scaling(
        outer.input_shift + outer.input_scale * scaling.input_shift,
        outer.input_scale * scaling.input_scale,
        scaling.output_shift,
        scaling.output_scale,
    )
    own = replace(
        problem,
        Z=scaling.inputs(problem.Z),
        T=scaling.outputs(problem.T),
        dT=None if problem.dT is None else scaling.derivatives(problem.dT),
        scaling=absolute,
        outcomes=None,
    )
    if own_box:
        X = outer.input_shift + outer.input_scale * problem.Z
        own = replace(own, bounds=np.stack([X.min(axis=0), X.max(axis=0)], axis=1), distributions=None)
    return Part(kind, scaling, kind_of(kind).train(own, rng, **options))
