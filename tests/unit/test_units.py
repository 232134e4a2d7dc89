import math
import pickle
import subprocess
import sys
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra.errors import ModelError
from tensegra.units import Dimension, QuantityError, Units

CM_KN = Units(length="cm", force="kN", temperature="degC")

# Decimal conversion rounds once more than multiplication by an exact power of ten does.
ROUNDING = 1e-15


def test_si_is_the_system_left_out():
    assert Units() == Units("m", "N", "K")


@pytest.mark.parametrize(
    ("dimension", "name"),
    [
        ("ratio", "1"),
        ("length", "cm"),
        ("area", "cm^2"),
        ("second moment of area", "cm^4"),
        ("force", "kN"),
        ("force per length", "kN/cm"),
        ("force per volume", "kN/cm^3"),
        ("stress", "kN/cm^2"),
        ("energy", "kN*cm"),
        ("temperature", "degC"),
        ("thermal expansion", "1/degC"),
    ],
)
def test_derived_units_are_named(dimension, name):
    assert CM_KN.of(dimension) == name


@pytest.mark.parametrize(
    ("quantity", "dimension", "number"),
    [
        ("255 mm^2", "area", 2.55),
        ("115 GPa", "stress", 11500.0),
        ("3 m", "length", 300.0),
        ("3m", "length", 300.0),
        ("1 in", "length", 2.54),
        ("12 µm", "length", 0.0012),
        ("77 kN/m^3", "force per volume", 7.7e-5),
        ("1.6e-5 1/K", "thermal expansion", 1.6e-5),
        ("1.6e-5 / degC", "thermal expansion", None),
        ("9e-6 1/degF", "thermal expansion", 1.62e-5),
        ("20 K", "temperature", 20.0),
        ("-20 degC", "temperature", -20.0),
        ("20 °C", "temperature", 20.0),
        ("20 delta_degC", "temperature", 20.0),
        ("36 degF", "temperature", 20.0),
        ("5 kN m", "energy", 500.0),
        ("2 kN*m", "energy", 200.0),
        ("8000 mm**4", "second moment of area", 0.8),
        ("-2.55 %", "ratio", -0.0255),
        ("1e6", "force", 1e6),
        (" .5 ", "force", 0.5),
        ("7850 kg/m^3", "force per volume", None),
        ("2 mm", "area", None),
        ("2 furlongz", "length", None),
        ("2 m**9**9", "length", None),
        ("2 m^99", "length", None),
        ("two m", "length", None),
        ("m", "length", None),
        ("", "length", None),
        ("1_000", "length", None),
        ("nan", "length", None),
        ("1e9999999999999 m", "length", None),
        ([1.0], "length", None),
        (None, "length", None),
        (True, "length", None),
    ],
)
def test_a_quantity_is_converted_into_the_declared_system(quantity, dimension, number):
    if number is None:
        with pytest.raises(QuantityError, match="a number"):
            CM_KN.number(quantity, dimension)
    else:
        assert CM_KN.number(quantity, dimension) == pytest.approx(number, rel=ROUNDING, abs=0.0)


def test_decimal_factors_leave_no_binary_dust():
    assert CM_KN.number("255 mm^2", "area") == 2.55  # 255 * 0.01 is 2.5500000000000003


def test_a_plain_number_is_in_the_declared_system_already():
    assert CM_KN.number(3, "length") == 3.0
    assert math.isinf(CM_KN.number(10**400, "length"))


@given(
    number=st.floats(allow_nan=False, allow_infinity=False), dimension=st.sampled_from(get_args(Dimension))
)
def test_a_number_written_with_its_own_unit_stays_itself(number, dimension):
    quantity = f"{number!r} {CM_KN.of(dimension)}" if dimension != "ratio" else repr(number)
    assert CM_KN.number(quantity, dimension) == pytest.approx(number, rel=ROUNDING)


@given(number=st.floats(1e-6, 1e6), dimension=st.sampled_from(get_args(Dimension)))
def test_conversion_there_and_back_is_the_identity(number, dimension):
    other = Units("ft", "lbf", "degF")
    there = other.number(f"{number!r} {CM_KN.of(dimension)}", dimension) if dimension != "ratio" else number
    back = CM_KN.number(f"{there!r} {other.of(dimension)}", dimension) if dimension != "ratio" else there
    assert back == pytest.approx(number, rel=4 * ROUNDING)


def test_the_expectation_names_the_unit_and_corrects_a_misspelt_one():
    with pytest.raises(QuantityError) as caught:
        CM_KN.number("3 Gpa", "stress")
    assert str(caught.value) == "a number (in kN/cm^2) or a quantity of stress such as '1 kN/cm^2'"
    assert caught.value.candidates == ("3 GPa",)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301 — our own pickle


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"length": "kN"}, r"units\.length: found 'kN', expected the name of a unit of length"),
        ({"force": "kn"}, r"units\.force: found 'kn', .*did you mean 'kN'\?"),
        ({"force": "kg"}, r"units\.force: found 'kg'"),
        ({"temperature": "degc"}, r"units\.temperature: found 'degc', .*did you mean 'degC'\?"),
        ({"length": "m^2/m"}, r"units\.length: found 'm\^2/m'"),
        ({"length": 3}, r"units\.length: found 3"),
    ],
)
def test_a_declared_unit_must_be_one_of_its_dimension(declared, message):
    with pytest.raises(ModelError, match=message):
        Units(**declared)


def test_an_uncommon_unit_may_be_declared():
    assert Units(length="yard").number("1 m", "length") == pytest.approx(1 / 0.9144)


def test_pint_is_imported_for_quantities_only():
    program = (
        "import sys; from tensegra.units import Units; u = Units('cm', 'kN', 'degC');"
        "u.number(1, 'area'); u.number('1e6', 'force'); assert 'pint' not in sys.modules;"
        "u.number('1 m', 'length'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)  # noqa: S603 — a fixed program
