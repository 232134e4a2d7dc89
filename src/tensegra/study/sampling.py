"""Designs of experiments: points of the unit cube, seeded, reproducible and extendable.

A sampler's points depend on its entry, the names of its variables and the seed alone. `sizes` is a
number of points, or a list of instalments that are drawn one after the other; a design with one more
instalment, or a Sobol or Halton design with a greater number, begins with the points it had before.

==================  ===========================================================================
sampler             when it is extended
==================  ===========================================================================
sobol, halton       a longer sequence begins with the shorter one
saltelli            the same, block by block
latin_hypercube     one hypercube for each instalment; append one to `sizes` to extend
full_factorial      2k − 1 levels contain k levels, if not centred
product             each factor by its own rule; the points keep their values, not their order
file                append rows
==================  ===========================================================================
"""

from collections.abc import Callable, Sequence
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from tensegra.errors import StudyError
from tensegra.study.entry import Count, Entry, Examples, Flag, Identifier

__all__ = [
    "Design",
    "FileDesign",
    "FullFactorial",
    "Halton",
    "LatinHypercube",
    "Product",
    "Saltelli",
    "Sampler",
    "Sobol",
    "n_design_points",
    "require_variables",
    "sampling_advice",
    "unit_points",
]

Array: TypeAlias = NDArray[np.float64]
Sizes: TypeAlias = Count | Annotated[tuple[Count, ...], Field(min_length=1)]

MAX_POINTS = 2**30
"""Length of SciPy's Sobol sequence, 30 bits; no other design needs more."""


class Sobol(Entry):
    """Sobol's sequence, randomised by Owen's scrambling (a linear matrix and a digital shift) or plain.

    Plain, its first point is the corner of the cube, which the box of a normal law places 4.75
    standard deviations out.
    """

    examples: ClassVar[Examples] = ({"sampler": "sobol", "sizes": 256, "scramble": True},)

    sampler: Literal["sobol"]
    """Kind of design."""
    sizes: Sizes
    """Number of points, or a list of instalments that are drawn one after the other. [1]"""
    scramble: Flag = True
    """Whether the sequence is randomised by Owen's scrambling, which an error estimate needs."""


class Halton(Entry):
    """Halton's sequence, scrambled or plain: even for any number of points."""

    examples: ClassVar[Examples] = ({"sampler": "halton", "sizes": [100, 50], "scramble": True},)

    sampler: Literal["halton"]
    """Kind of design."""
    sizes: Sizes
    """Number of points, or a list of instalments that are drawn one after the other. [1]"""
    scramble: Flag = True
    """Whether the sequence is randomised."""


class LatinHypercube(Entry):
    """Latin hypercubes: in every coordinate one point in each of n equal slices.

    `optimised` shuffles the coordinates until the centred discrepancy falls no more (the cost grows
    with the square of the number of points); `centred` puts the points in the middle of the slices.
    """

    examples: ClassVar[Examples] = (
        {"sampler": "latin_hypercube", "sizes": 100, "optimised": True, "centred": False},
    )

    sampler: Literal["latin_hypercube"]
    """Kind of design."""
    sizes: Sizes
    """Number of points, or a list of instalments, each a hypercube of its own. [1]"""
    optimised: Flag = False
    """Whether the coordinates are shuffled until the centred discrepancy falls no more."""
    centred: Flag = False
    """Whether the points stand in the middle of their slices."""


class FullFactorial(Entry):
    """All combinations of equally spaced levels, the last variable running fastest.

    The levels include both ends of the box or, `centred`, are the middles of equal slices.
    """

    examples: ClassVar[Examples] = (
        {"sampler": "full_factorial", "levels": {"A14": 5, "A23": 3}, "centred": True},
    )

    sampler: Literal["full_factorial"]
    """Kind of design."""
    levels: Count | dict[Identifier, Count]
    """Number of levels of each variable, one for all or by variable. [1]"""
    centred: Flag = False
    """Whether the levels are the middles of equal slices; else they include both ends of the box."""


class Saltelli(Entry):
    """Blocks for Sobol indices: A, each A with one coordinate from B, (each B with one from A,) B.

    `sizes` counts base points, the rows of A; a block has d + 2 points, or 2d + 2 for `second_order`.
    A and B are two halves of a Sobol sequence in 2d dimensions (Saltelli, *Comput. Phys. Commun.* 145
    (2002) 280-297), and the order is SALib's.
    """

    examples: ClassVar[Examples] = (
        {"sampler": "saltelli", "sizes": 64, "second_order": False, "scramble": True},
    )

    sampler: Literal["saltelli"]
    """Kind of design."""
    sizes: Sizes
    """Number of base points, or a list of instalments; a block has d + 2 points for d variables, or 2d + 2.
    [1]"""
    second_order: Flag = False
    """Whether the blocks hold the points for second-order indices, too."""
    scramble: Flag = True
    """Whether the sequence is randomised."""


Sampler: TypeAlias = Annotated[
    Sobol | Halton | LatinHypercube | FullFactorial | Saltelli, Field(discriminator="sampler")
]


class Factor(Entry):
    """One factor of a product: a design over some of the variables."""

    examples: ClassVar[Examples] = ({"variables": ["A14"], "design": {"sampler": "sobol", "sizes": 16}},)

    variables: tuple[Identifier, ...] = Field(min_length=1)
    """Names of the variables of this factor."""
    design: Sampler
    """Design over these variables."""


class Product(Entry):
    """Every point of the first design with every point of the next, the last running fastest.

    The paper's 100 actuations with 125 temperatures are a product of two Sobol designs.
    """

    examples: ClassVar[Examples] = (
        {
            "sampler": "product",
            "factors": [
                {"variables": ["A14"], "design": {"sampler": "sobol", "sizes": 16}},
                {"variables": ["A23"], "design": {"sampler": "halton", "sizes": 8}},
            ],
        },
    )

    sampler: Literal["product"]
    """Kind of design."""
    factors: tuple[Factor, ...] = Field(min_length=2)
    """Designs over some of the variables each; every point of one is run with every point of the others."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        names = [name for factor in self.factors for name in factor.variables]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"found the variable {name!r} in two places, expected it in one factor")
        return self


class FileDesign(Entry):
    """Points from a table, CSV or Parquet by its suffix, with a column for each variable."""

    examples: ClassVar[Examples] = ({"sampler": "file", "file": "points.csv"},)

    sampler: Literal["file"]
    """Kind of design."""
    file: str
    """CSV or Parquet file relative to the study's, with a column for each variable."""


Design: TypeAlias = Annotated[
    Sobol | Halton | LatinHypercube | FullFactorial | Saltelli | Product | FileDesign,
    Field(discriminator="sampler"),
]


def unit_points(design: Entry, names: Sequence[str], seed: int) -> Array:
    """Return the points of a design in the unit cube.

    Parameters
    ----------
    design
        Any design but a `FileDesign`, whose points are no points of the unit cube.
    names
        The variables, in the order of the columns.
    seed
        Seed of the randomised samplers.

    Returns
    -------
    ndarray
        Shape (n_points, len(names)), values in [0, 1].

    Raises
    ------
    StudyError
        If the design names a variable that there is not, or leaves one out.

    Examples
    --------
    >>> unit_points(Sobol(sampler="sobol", sizes=3, scramble=False), ["a", "b"], seed=0)
    array([[0.  , 0.  ],
           [0.5 , 0.5 ],
           [0.75, 0.25]])
    """
    require_variables(design, names)
    return _UNIT_POINTS[type(design)](design, names, seed)


def require_variables(design: Entry, names: Sequence[str], place: str = "design") -> None:
    """Refuse, without drawing its points, a design that does not fit the variables.

    Raises
    ------
    StudyError
        If the design names a variable that there is not, leaves one out, or has too many points.
    """
    if isinstance(design, FullFactorial) and isinstance(design.levels, dict):
        _require_same_names(list(design.levels), names, f"{place}.levels")
    if isinstance(design, Product):
        named = [name for factor in design.factors for name in factor.variables]
        _require_same_names(named, names, f"{place}.factors")
        for i, factor in enumerate(design.factors):
            require_variables(factor.design, factor.variables, f"{place}.factors[{i}].design")
    n_points = n_design_points(design, len(names))
    if n_points > MAX_POINTS:
        raise StudyError.at(place, f"{n_points} points", f"at most {MAX_POINTS}")


def n_design_points(design: Entry, n_inputs: int) -> int:
    """Return the number of points of a design in `n_inputs` variables, without drawing them.

    Examples
    --------
    >>> n_design_points(Saltelli(sampler="saltelli", sizes=[8, 8]), n_inputs=3)
    80
    """
    match design:
        case Sobol() | Halton() | LatinHypercube():
            return sum(_instalments(design.sizes))
        case Saltelli():
            return sum(_instalments(design.sizes)) * _block_size(design, n_inputs)
        case FullFactorial(levels=int(levels)):
            return int(levels**n_inputs)
        case FullFactorial(levels=dict(levels)):
            return int(np.prod([float(count) for count in levels.values()]))
        case Product():
            counts = [n_design_points(factor.design, len(factor.variables)) for factor in design.factors]
            return int(np.prod([float(count) for count in counts]))
    raise StudyError.at("design", type(design).__name__, "a design whose number of points is known")


def sampling_advice(design: Entry) -> tuple[str, ...]:
    """Return what a user should know of a design that is allowed but not at its best.

    Examples
    --------
    >>> sampling_advice(Sobol(sampler="sobol", sizes=1000))
    ('1000 points of a Sobol sequence lose its balance; 1024 would keep it',)
    """
    if isinstance(design, Product):
        return tuple(advice for factor in design.factors for advice in sampling_advice(factor.design))
    if not isinstance(design, Sobol | Saltelli):
        return ()
    advice = []
    n_points = sum(_instalments(design.sizes))
    if n_points & (n_points - 1):
        power = 1 << (n_points.bit_length() - 1)
        near = power if n_points < 1.5 * power else 2 * power
        advice.append(f"{n_points} points of a Sobol sequence lose its balance; {near} would keep it")
    if not design.scramble:
        advice.append("the first point of a plain Sobol sequence is a corner of the box")
    return tuple(advice)


def _instalments(sizes: int | tuple[int, ...]) -> tuple[int, ...]:
    return (sizes,) if isinstance(sizes, int) else sizes


def _sobol(design: Sobol, names: Sequence[str], seed: int) -> Array:
    return _sobol_sequence(sum(_instalments(design.sizes)), len(names), design.scramble, seed)


def _sobol_sequence(n_points: int, dimension: int, scramble: bool, seed: int) -> Array:
    from scipy.stats import qmc

    engine = qmc.Sobol(dimension, scramble=scramble, rng=np.random.default_rng(seed))
    # Drawn by the power of two, SciPy has nothing to warn of, and a prefix is the shorter sequence.
    points: Array = engine.random_base2((n_points - 1).bit_length())
    return points[:n_points]


def _halton(design: Halton, names: Sequence[str], seed: int) -> Array:
    from scipy.stats import qmc

    engine = qmc.Halton(len(names), scramble=design.scramble, rng=np.random.default_rng(seed))
    points: Array = engine.random(sum(_instalments(design.sizes)))
    return points


def _latin_hypercube(design: LatinHypercube, names: Sequence[str], seed: int) -> Array:
    from scipy.stats import qmc

    optimisation: Literal["random-cd"] | None = "random-cd" if design.optimised else None
    cubes = [
        # A discrepancy, and so an optimisation, needs two points.
        qmc.LatinHypercube(
            len(names),
            scramble=not design.centred,
            optimization=optimisation if size > 1 else None,
            rng=np.random.default_rng([seed, instalment]),
        ).random(size)
        for instalment, size in enumerate(_instalments(design.sizes))
    ]
    return np.concatenate(cubes)


def _full_factorial(design: FullFactorial, names: Sequence[str], _seed: int) -> Array:
    if isinstance(design.levels, int):
        counts = [design.levels] * len(names)
    else:
        counts = [design.levels[name] for name in names]
    grid = np.meshgrid(*[_levels(count, design.centred) for count in counts], indexing="ij")
    return np.stack([axis.ravel() for axis in grid], axis=1)


def _levels(count: int, centred: bool) -> Array:
    if centred or count == 1:
        return (np.arange(count) + 0.5) / count
    # Divided, not accumulated, so that a level that two grids share is the same number to the bit.
    return np.arange(count) / (count - 1)


def _saltelli(design: Saltelli, names: Sequence[str], seed: int) -> Array:
    d = len(names)
    base = _sobol_sequence(sum(_instalments(design.sizes)), 2 * d, design.scramble, seed)
    A, B = base[:, None, :d], base[:, None, d:]
    diagonal = np.eye(d, dtype=np.bool_)
    parts = [A, np.where(diagonal, B, A)]
    if design.second_order:
        parts.append(np.where(diagonal, A, B))
    return np.concatenate([*parts, B], axis=1).reshape(-1, d)


def _block_size(design: Saltelli, n_inputs: int) -> int:
    return (2 if design.second_order else 1) * n_inputs + 2


def _product(design: Product, names: Sequence[str], seed: int) -> Array:
    # Each factor has its own seed: two designs of the same kind and size must not be the same points.
    seeds = np.random.SeedSequence(seed).generate_state(len(design.factors))
    parts = [
        unit_points(factor.design, factor.variables, int(factor_seed))
        for factor, factor_seed in zip(design.factors, seeds, strict=True)
    ]
    rows = np.meshgrid(*[np.arange(len(part)) for part in parts], indexing="ij")
    points = np.empty((rows[0].size, len(names)))
    for factor, part, row in zip(design.factors, parts, rows, strict=True):
        points[:, [names.index(name) for name in factor.variables]] = part[row.ravel()]
    return points


def _require_same_names(found: Sequence[str], names: Sequence[str], place: str) -> None:
    for name in found:
        if name not in names:
            raise StudyError.at(place, name, "a variable", candidates=names)
    missing = [name for name in names if name not in found]
    if missing:
        raise StudyError(f"{place}: expected every variable, {missing[0]!r} is missing")


_UNIT_POINTS: dict[type[Entry], Callable[[Any, Sequence[str], int], Array]] = {
    Sobol: _sobol,
    Halton: _halton,
    LatinHypercube: _latin_hypercube,
    FullFactorial: _full_factorial,
    Saltelli: _saltelli,
    Product: _product,
}
"""How each design is drawn; a new sampler is an entry, a function and a line here."""
