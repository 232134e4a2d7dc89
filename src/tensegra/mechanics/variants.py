"""Runs that change the structure itself, before its first stage: moduli, areas, rest lengths."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tensegra.errors import ModelError
from tensegra.mechanics.arrays import FloatArray, StructureArrays, lumped_weight
from tensegra.structure import Structure
from tensegra.structure.overlaps import require_one_change


@dataclass(frozen=True)
class Variants:
    """What differs between the structures of many runs; every value is an array ``(n_runs,)``.

    Attributes
    ----------
    youngs_modulus
        By material, force per area.
    area
        By member or group.
    rest_length
        By member: rest length before the stages.
    """

    youngs_modulus: Mapping[str, FloatArray]
    area: Mapping[str, FloatArray]
    rest_length: Mapping[str, FloatArray]

    @property
    def vary(self) -> bool:
        """Whether any structure differs from the others."""
        return bool(self.youngs_modulus or self.area or self.rest_length)

    def part(self, runs: slice) -> "Variants":
        """Return the variants of some runs."""
        return Variants(*({name: values[runs] for name, values in group.items()} for group in self.groups()))

    def check(self, structure: Structure) -> None:
        """Raise `ModelError` for a name that the structure does not have or a value that cannot be.

        A member of which two names set the area is refused with both of them.
        """
        known = {"youngs_modulus": structure.materials, "rest_length": structure.members}
        for what, names in known.items():
            for name in getattr(self, what):
                if name not in names:
                    raise ModelError.at(what, name, "a material or a member", candidates=names)
        require_one_change(structure, "area", self.area)
        without = [
            m
            for name in self.area
            for m in structure.members_named(name)
            if structure.members[m].area is None
        ]
        if without:
            raise ModelError.at("area", without[0], "members with an area, not given by their stiffness")
        for what, group in zip(("youngs_modulus", "area", "rest_length"), self.groups(), strict=True):
            for name, values in group.items():
                if not np.all((values > 0.0) & (values < np.inf)):
                    raise ModelError.at(f"{what} {name}", values, "positive numbers")

    def groups(self) -> tuple[Mapping[str, FloatArray], ...]:
        """Return the three mappings, in the order of the attributes."""
        return self.youngs_modulus, self.area, self.rest_length


def varied_structure(structure: Structure, variants: Variants, run: int) -> Structure:
    """Return the structure of one run."""
    if not variants.vary:
        return structure
    materials, members = dict(structure.materials), dict(structure.members)
    for name, values in variants.youngs_modulus.items():
        materials[name] = replace(materials[name], youngs_modulus=float(values[run]))
    for name, values in variants.area.items():
        for member in structure.members_named(name):
            members[member] = replace(members[member], area=float(values[run]))
    for name, values in variants.rest_length.items():
        members[name] = replace(members[name], rest_length=float(values[run]))
    return structure.replace(materials=materials, members=members)


def varied_arrays(structure: Structure, arrays: StructureArrays, variants: Variants) -> StructureArrays:
    """Return the arrays of all runs: stiffness, rest lengths and weights get a leading axis of runs."""
    if not variants.vary:
        return arrays
    n_runs = len(next(values for group in variants.groups() for values in group.values()))
    stiffness = np.tile(arrays.stiffness, (n_runs, 1))
    rest_length = np.tile(arrays.rest_length, (n_runs, 1))
    weight = np.tile(
        np.array([structure.weight_per_length(member) for member in structure.members]), (n_runs, 1)
    )
    for name, values in variants.youngs_modulus.items():
        relative = values / structure.materials[name].youngs_modulus
        for member, e in arrays.member_index.items():
            if structure.members[member].material == name and structure.members[member].area is not None:
                stiffness[:, e] *= relative
    for name, values in variants.area.items():
        for member in structure.members_named(name):
            e, area = arrays.member_index[member], structure.members[member].area
            relative = values / (area or np.nan)  # `check` has seen to it that there is an area
            stiffness[:, e] *= relative
            weight[:, e] *= relative
    for name, values in variants.rest_length.items():
        rest_length[:, arrays.member_index[name]] = values
    return replace(
        arrays,
        stiffness=stiffness,
        rest_length=rest_length,
        nodal_weight=lumped_weight(arrays, weight),
    )
