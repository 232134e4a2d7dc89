"""A cable that hangs under a load of 10 N: z = −(1 − A)(1 + 10/E), A and E random or searched."""

import numpy as np

from tensegra.study import parse_study

STRUCTURE = {
    "name": "hanging cable",
    "units": {"length": "m", "force": "N"},
    "nodes": {1: [0, 0, 0], 2: [0, 0, -1]},
    "materials": {"m": {"youngs_modulus": 100}},
    "members": {"c": {"kind": "cable", "nodes": [1, 2], "material": "m", "area": 1, "rest_length": 1}},
    "supports": {1: "xyz", 2: "xy"},
    "actuators": {"A": {"members": ["c"], "effect": "shorten"}},
    "stages": [{"name": "load", "loads": {2: [0, 0, -10]}}],
}
STEEL = {"normal": {"mean": 100, "std": 5}}


def height(A, E):
    return -(1 - A) * (1 + 10 / E)


def hanging(actuation, modulus=STEEL, **more):
    return parse_study(
        {
            "structure": STRUCTURE,
            "seed": 1,
            "variables": {
                "A": {"actuator": "A", "distribution": actuation},
                "E": {"youngs_modulus": "m", "distribution": modulus},
            },
            "outputs": {"z": {"coordinate": "z", "nodes": [2]}},
            "design": {"sampler": "sobol", "sizes": 256},
            **more,
        }
    )


def exact_moments(study, n=2**16):
    """Mean and standard deviation of the closed form under a study's joint law."""
    z = height(*study.space.from_unit(np.random.default_rng(5).random((n, 2))).T)
    return z.mean(), z.std()
