"""Unit systems: the one a structure declares, and the conversion of quantities into it.

A structure declares a unit of length, of force and of temperature; every other unit is derived from
these, so the system is consistent and the mathematics needs no conversion. Plain numbers are in that
system. A quantity that carries its own unit, such as ``255 mm^2``, is converted once, on reading, by
`pint`, which is imported only when such a quantity (or an uncommon declared unit) is met.

Temperatures are differences from the stress-free state throughout, so 20 degC and 20 K are the same.
"""

import re
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from math import inf
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal, get_args

from tensegra.errors import ModelError, nearest

if TYPE_CHECKING:
    import pint

__all__ = ["LARGEST", "SMALLEST", "Dimension", "QuantityError", "Units", "as_float", "is_number", "is_sane"]

SMALLEST, LARGEST = 1e-100, 1e100
"""Sizes between which a number that is not 0 has to lie, in any units: a stiffness multiplies and divides
three of them, and is still a normal float. The smallest floats have lost their digits before that."""

Dimension = Literal[
    "ratio",
    "length",
    "area",
    "second moment of area",
    "force",
    "force per length",
    "force per volume",
    "stress",
    "energy",
    "temperature",
    "thermal expansion",
]

# Exponents of force, length and temperature.
_EXPONENTS: dict[Dimension, tuple[int, int, int]] = {
    "ratio": (0, 0, 0),
    "length": (0, 1, 0),
    "area": (0, 2, 0),
    "second moment of area": (0, 4, 0),
    "force": (1, 0, 0),
    "force per length": (1, -1, 0),
    "force per volume": (1, -3, 0),
    "stress": (1, -2, 0),
    "energy": (1, 1, 0),
    "temperature": (0, 0, 1),
    "thermal expansion": (0, 0, -1),
}

BaseDimension = Literal["length", "force", "temperature"]

# Declared as one of these, a unit needs no look-up in pint.
_COMMON: dict[BaseDimension, tuple[str, ...]] = {
    "length": ("m", "cm", "mm", "km", "in", "ft"),
    "force": ("N", "kN", "MN", "lbf", "kip"),
    "temperature": ("K", "degC", "degF"),
}

# Names to offer for a misspelt one in a quantity.
_NAMES = (*sum(_COMMON.values(), ()), "Pa", "kPa", "MPa", "GPa", "psi", "ksi")

# A scale with an offset stands for its differences.
_DIFFERENCE_OF = {
    "degree_Celsius": "delta_degree_Celsius",
    "degree_Fahrenheit": "delta_degree_Fahrenheit",
    "degree_Reaumur": "delta_degree_Reaumur",
}

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_UNIT_NAME = r"[^\W\d]\w*|°\w+|%"
_FACTOR = rf"(?:{_UNIT_NAME})(?:\s*(?:\^|\*\*)\s*-?\d)?"
# Products, quotients and one-digit powers of names: all that a unit needs, and nothing to evaluate.
_UNIT = rf"(?:1\s*/\s*)?{_FACTOR}(?:\s*[*/·\s]\s*{_FACTOR})*"
LONGEST_QUANTITY = 120
"""Characters of a quantity: a unit of five thousand factors is none, and pint calls itself for each."""

_NUMBER_ONLY = re.compile(rf"\s*({_NUMBER})\s*")
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*({_UNIT})\s*")


class QuantityError(ValueError):
    """A value that is no number and no quantity of the dimension asked for.

    The message is the phrase that says what was expected, ready to follow the word "expected" in an
    error that knows the place; `candidates` are corrections of a misspelt unit.
    """

    def __init__(self, expected: str, candidates: tuple[str, ...] = ()) -> None:
        super().__init__(expected, candidates)
        self.candidates = candidates

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True)
class Units:
    """The unit system of a structure: its units of length, force and temperature.

    Parameters
    ----------
    length, force, temperature
        Names that `pint` knows. Left out, they are those of the SI: metre, newton and kelvin.

    Raises
    ------
    ModelError
        A name that is no unit, or a unit of something else.

    Examples
    --------
    >>> units = Units(length="cm", force="kN", temperature="degC")
    >>> units.of("stress")
    'kN/cm^2'
    >>> units.number("115 GPa", "stress"), units.number(11500, "stress")
    (11500.0, 11500.0)
    """

    length: str = "m"
    force: str = "N"
    temperature: str = "K"

    def __post_init__(self) -> None:
        for dimension in get_args(BaseDimension):
            name = getattr(self, dimension)
            if not _is_unit_of(name, dimension):
                raise ModelError.at(
                    f"units.{dimension}",
                    name,
                    f"the name of a unit of {dimension}, such as '{_COMMON[dimension][1]}'",
                    candidates=_COMMON[dimension],
                )

    def __str__(self) -> str:
        return f"{self.length}, {self.force}"

    def of(self, dimension: Dimension) -> str:
        """Return the name of this system's unit of `dimension`; "1" for a ratio.

        Examples
        --------
        >>> Units().of("force per volume"), Units().of("thermal expansion"), Units().of("ratio")
        ('N/m^3', '1/K', '1')
        """
        names = (self.force, self.length, self.temperature)
        powers = list(zip(names, _EXPONENTS[dimension], strict=True))
        above = "*".join(_power(name, exponent) for name, exponent in powers if exponent > 0)
        below = "/".join(_power(name, -exponent) for name, exponent in powers if exponent < 0)
        return f"{above or '1'}/{below}" if below else above or "1"

    def number(self, value: object, dimension: Dimension) -> float:
        """Return `value` as a number in this system's unit of `dimension`.

        Parameters
        ----------
        value
            A number, which is in this system already, or a text with a number (`"1e6"`) or a number
            and its unit (`"255 mm^2"`).
        dimension
            What the number measures.

        Returns
        -------
        float
            The number, correctly rounded; it may be infinite or NaN, as `value` may.

        Raises
        ------
        QuantityError
            `value` is neither, or its unit measures something else.
        """
        if isinstance(value, str) and len(value) <= LONGEST_QUANTITY:
            if plain := _NUMBER_ONLY.fullmatch(value):
                return float(plain[1])
            if (quantity := _QUANTITY.fullmatch(value)) and (unit := _unit(quantity[2])) is not None:
                converted = self._convert(quantity[1], unit, dimension)
                if converted is not None:
                    return converted
        elif is_number(value):
            return as_float(value)
        raise QuantityError(self._expected(dimension), _corrections(value))

    def _convert(self, amount: str, unit: "pint.Unit", dimension: Dimension) -> float | None:
        target = _unit(self.of(dimension)) if dimension != "ratio" else _registry().dimensionless
        if target is None or unit.dimensionality != target.dimensionality:
            return None
        try:
            return float(_registry().Quantity(Decimal(amount), unit).to(target).magnitude)
        except ArithmeticError:  # an exponent that no number has
            return None

    def _expected(self, dimension: Dimension) -> str:
        if dimension == "ratio":
            return "a number"
        unit = self.of(dimension)
        return f"a number (in {unit}) or a quantity of {dimension} such as '1 {unit}'"


def is_number(value: object) -> bool:
    """Tell whether `value` is a real number; a truth value is none.

    Examples
    --------
    >>> is_number(1), is_number(float("nan")), is_number(True), is_number("1")
    (True, True, False, False)
    """
    # The exact type first: asking the abstract class is slow, and nearly every number is a float.
    return type(value) is float or (isinstance(value, Real) and not isinstance(value, bool))


def is_sane(value: float) -> bool:
    """Tell whether a finite number is 0 or of a size that can be computed with.

    Examples
    --------
    >>> is_sane(0.0), is_sane(-6e-17), is_sane(1e-320), is_sane(-1e308)
    (True, True, False, False)
    """
    return value == 0.0 or SMALLEST <= abs(value) <= LARGEST


def as_float(value: Any) -> float:  # noqa: ANN401 — any real number
    """Return a real number as a float, infinite if it is too large for one.

    Examples
    --------
    >>> as_float(2), as_float(10**400)
    (2.0, inf)
    """
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf


def _corrections(value: object) -> tuple[str, ...]:
    """Return a quantity with its unknown units replaced by the nearest common ones, if there are any."""
    short = isinstance(value, str) and len(value) <= LONGEST_QUANTITY
    quantity = _QUANTITY.fullmatch(value) if isinstance(value, str) and short else None
    if quantity is None:
        return ()

    def known(name: re.Match[str]) -> str:
        return name[0] if _unit(name[0]) else nearest(name[0], _NAMES) or name[0]

    corrected = re.sub(_UNIT_NAME, known, quantity[2])
    return (f"{quantity[1]} {corrected}",) if corrected != quantity[2] else ()


def _power(name: str, exponent: int) -> str:
    return name if exponent == 1 else f"{name}^{exponent}"


def _is_unit_of(name: object, dimension: BaseDimension) -> bool:
    if not isinstance(name, str):
        return False
    if name in _COMMON[dimension]:
        return True
    if len(name) > LONGEST_QUANTITY or not re.fullmatch(_UNIT_NAME, name):
        return False
    unit, reference = _unit(name), _unit(_COMMON[dimension][0])
    return unit is not None and reference is not None and unit.dimensionality == reference.dimensionality


@cache
def _registry() -> "pint.UnitRegistry[Decimal]":
    import pint

    # Decimal factors keep 255 mm^2 at 2.55 cm^2, where binary ones would give 2.5500000000000003.
    return pint.UnitRegistry(non_int_type=Decimal)


@cache
def _unit(text: str) -> "pint.Unit | None":
    """Return the unit that `text` names, a scale with an offset as its difference; None if unknown."""
    import pint

    registry = _registry()
    try:
        unit = registry.parse_units(text.replace("·", "*"))
        difference = registry.parse_units(_DIFFERENCE_OF.get(str(unit), str(unit)))
        # A power of zero leaves pint a unit that it cannot convert.
        return None if any(power == 0 for power in difference._units.values()) else difference  # noqa: SLF001 - there is no public way to see them
    # What pint raises on a foreign text follows from how it happens to parse it.
    except (pint.PintError, ValueError, AssertionError, LookupError, TypeError, AttributeError):
        return None
    except (ArithmeticError, RecursionError, SyntaxError):
        return None
