"""Lanes: eight runs in one vector value, so that a kernel is written as for one run.

A kernel reads and writes rows of its fields with `load` and `store`. From a field of shape ``(n,)``
a row is a float; from one of shape ``(n, WIDTH)`` it is a `Pack`, a vector value that the compiler
keeps in registers. The same source is thereby compiled twice: for a single structure, and for eight
runs of it in lockstep at hardly more than the price of one.

Fields are given by the addresses of their first elements, since every array that a kernel takes costs the
compiler a hundredth of a second in each function that it passes through, and there are eighty of them:
an address that is a signed integer is that of packs, an unsigned one that of floats. Who calls a kernel
keeps the arrays alive (`tensegra.mechanics.state.Workspace`).

A lane computes bit for bit what the kernel computes for one run: a product and a sum are rounded
once only where `fused` says so, never at the compiler's discretion.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin, models, register_model

from tensegra.mechanics.numba_private import (
    AbstractTemplate,
    call_function,
    first_element,
    infer_global,
    nothing,
    signature,
)

WIDTH = 8
"""Lanes of a pack: 8 doubles fill an AVX-512 register, two of AVX2, four of NEON."""

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_INDEX = ir.IntType(32)


class PackType(types.Type):
    """Numba type of a vector of `WIDTH` doubles."""

    def __init__(self) -> None:
        super().__init__(name=f"Pack({WIDTH})")


pack = PackType()


@register_model(PackType)
class _PackModel(models.PrimitiveModel):
    def __init__(self, manager: Any, frontend_type: Any) -> None:
        super().__init__(manager, frontend_type, _VECTOR)


def _is_wide(array: Any) -> bool:
    """Whether a field holds packs: an address that is signed, or an array with two axes."""
    kind: Any = array
    return bool(kind.signed if isinstance(array, types.Integer) else kind.ndim == 2)


def _row_type(array: Any) -> Any:
    return pack if _is_wide(array) else types.float64


def _data(context: Any, builder: Any, array_type: Any, array: Any) -> Any:
    """Return a pointer to the first element of a field."""
    if isinstance(array_type, types.Integer):
        return builder.inttoptr(array, ir.DoubleType().as_pointer())
    return first_element(context, builder, array_type, array)


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, row: Any) -> Any:
    data = _data(context, builder, array_type, array)
    if not _is_wide(array_type):
        return builder.gep(data, [row])
    first = builder.mul(row, ir.Constant(row.type, WIDTH))
    return builder.bitcast(builder.gep(data, [first]), _VECTOR.as_pointer())


@intrinsic
def _load(_typing: Any, array: Any, _row: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        value = builder.load(_pointer(context, builder, signature.args[0], *arguments))
        value.align = 8
        return value

    return _row_type(array)(array, types.int64), generate


@intrinsic
def _store(_typing: Any, array: Any, _row: Any, _value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        target, row, value = arguments
        instruction = builder.store(value, _pointer(context, builder, signature.args[0], target, row))
        instruction.align = 8
        return nothing(context)

    return types.void(array, types.int64, _row_type(array)), generate


def _element(context: Any, builder: Any, array_type: Any, array: Any, row: Any, lane: Any) -> Any:
    data = _data(context, builder, array_type, array)
    if _is_wide(array_type):
        row = builder.add(builder.mul(row, ir.Constant(row.type, WIDTH)), lane)
    return builder.gep(data, [row])


@intrinsic
def _get(_typing: Any, array: Any, _row: Any, _lane: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_element(context, builder, signature.args[0], *arguments))

    return types.float64(array, types.int64, types.int64), generate


@intrinsic
def _put(_typing: Any, array: Any, _row: Any, _lane: Any, _value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        target, row, lane, value = arguments
        builder.store(value, _element(context, builder, signature.args[0], target, row, lane))
        return nothing(context)

    return types.void(array, types.int64, types.int64, types.float64), generate


def _read(kind: Any, of: Any) -> Any:
    """Build what reads an element of an array by the address of its first."""

    @intrinsic
    def operation(_typing: Any, address: Any, _row: Any) -> Any:
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return builder.load(builder.gep(builder.inttoptr(arguments[0], of.as_pointer()), [arguments[1]]))

        return kind(address, types.int64), generate

    return operation


@intrinsic
def _count(_typing: Any, array: Any) -> Any:
    def generate(_context: Any, _builder: Any, signature: Any, _arguments: Any) -> Any:
        return ir.Constant(ir.IntType(64), WIDTH if _is_wide(signature.args[0]) else 1)

    return types.int64(array), generate


@intrinsic
def _zero(_typing: Any, array: Any) -> Any:
    def generate(_context: Any, _builder: Any, signature: Any, _arguments: Any) -> Any:
        if signature.return_type is pack:
            return ir.Constant(_VECTOR, [0.0] * WIDTH)
        return ir.Constant(ir.DoubleType(), 0.0)

    return _row_type(array)(array), generate


def _splat(builder: Any, value: Any) -> Any:
    """Write the same float to all lanes."""
    if value.type == _VECTOR:
        return value
    empty = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(empty, value, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(_INDEX, WIDTH), [0] * WIDTH))


class _Arithmetic(AbstractTemplate):
    """An operation on packs takes a float on either side."""

    def generic(self, arguments: Any, _keywords: Any) -> Any:
        if pack in arguments and all(kind is pack or kind == types.float64 for kind in arguments):
            return signature(pack, *arguments)
        return None


def _declare(symbol: Any, instruction: str) -> None:
    infer_global(symbol)(type(f"_{instruction}", (_Arithmetic,), {}))

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        left, right = (_splat(builder, argument) for argument in arguments)
        return getattr(builder, instruction)(left, right)

    for kinds in ((PackType, PackType), (PackType, types.Float), (types.Float, PackType)):
        lower_builtin(symbol, *kinds)(generate)


_declare(operator.add, "fadd")
_declare(operator.sub, "fsub")
_declare(operator.mul, "fmul")
_declare(operator.truediv, "fdiv")


@intrinsic
def _fused(_typing: Any, left: Any, right: Any, term: Any) -> Any:
    kind = pack if pack in (left, right, term) else types.float64

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        vector = kind is pack
        values = [_splat(builder, value) for value in arguments] if vector else list(arguments)
        of, name = (_VECTOR, f"v{WIDTH}f64") if vector else (ir.DoubleType(), "f64")
        return call_function(builder, ir.FunctionType(of, [of] * 3), f"llvm.fma.{name}", values)

    return kind(left, right, term), generate


def _compared(condition: str, otherwise: str) -> Any:
    """Build a choice between two values by a comparison of the first with the second or with zero."""

    @intrinsic
    def operation(_typing: Any, left: Any, _right: Any) -> Any:
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            left, right = arguments
            kind = left.type
            one = ir.Constant(kind, [1.0] * WIDTH if kind == _VECTOR else 1.0)
            null = ir.Constant(kind, [0.0] * WIDTH if kind == _VECTOR else 0.0)
            holds = builder.fcmp_ordered(condition, left, right)
            return builder.select(holds, *((left, right) if otherwise == "right" else (one, null)))

        return left(left, left), generate

    return operation


maximum: Any = _compared(">", "right")
"""The larger of two values, lane by lane."""
less: Any = _compared("<", "mask")
"""1.0 where the first value is the smaller, else 0.0, lane by lane."""


@intrinsic
def _choose(_typing: Any, _mask: Any, left: Any, _right: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        mask, left, right = arguments
        null = ir.Constant(mask.type, [0.0] * WIDTH if mask.type == _VECTOR else 0.0)
        return builder.select(builder.fcmp_unordered("!=", mask, null), left, right)

    return left(left, left, left), generate


def _unary(name: str) -> Any:
    @intrinsic
    def operation(_typing: Any, value: Any) -> Any:
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            kind = arguments[0].type
            full_name = f"{name}.v{WIDTH}f64" if kind == _VECTOR else f"{name}.f64"
            return call_function(builder, ir.FunctionType(kind, [kind]), full_name, arguments)

        return value(value), generate

    return operation


root: Any = _unary("llvm.sqrt")
"""Square root, lane by lane."""
magnitude: Any = _unary("llvm.fabs")
"""Absolute value, lane by lane."""

# Compiled functions take floats and packs: no annotation says so, so none is claimed.
fused: Any = _fused
"""a·b + c with a single rounding, lane by lane."""
load: Any = _load
"""Read a row of an array: a float from ``(n,)``, a pack from ``(n, WIDTH)``."""
store: Any = _store
"""Write a row of an array."""
get: Any = _get
"""Read a row of one lane, a float; of an array ``(n,)`` the only lane there is."""
put: Any = _put
"""Write a row of one lane."""
item: Any = _read(types.int64, ir.IntType(64))
"""Read an element of an array of integers by the address of its first."""
number: Any = _read(types.float64, ir.DoubleType())
"""Read an element of an array of floats by the address of its first, whatever the number of lanes."""
count_lanes: Any = _count
"""Return the number of lanes of a field: one, or `WIDTH`."""
zero: Any = _zero
"""Return nothing, in the width of the rows of an array."""
choose: Any = _choose
"""Return the second value where the first is not zero, else the third, lane by lane."""
