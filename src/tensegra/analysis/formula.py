"""The trees behind expressions, and their evaluation in forward mode.

Each node carries its values (n,) and its partial derivatives (n, n_seeds) by the seeds, the names that the
caller differentiates by. With no seeds the slopes have no columns and cost nothing.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError

Array = NDArray[np.float64]


class _Dual(NamedTuple):
    """Values (n,) and their partial derivatives (n, n_seeds)."""

    value: Array
    slope: Array


@dataclass(frozen=True, slots=True)
class Number:
    """A constant."""

    value: float


@dataclass(frozen=True, slots=True)
class Name:
    """A column, by its name."""

    name: str


@dataclass(frozen=True, slots=True)
class Operation:
    """A function or an operator on its arguments; `kink` numbers the first of its kinks."""

    verb: str
    arguments: tuple["Node", ...]
    kink: int = -1


Node = Number | Name | Operation


CHAINED = frozenset("+-*/")
"""Operators that are carried out from left to right: a sum of a thousand terms is long, but not deep."""


def chain(node: Node) -> tuple[Node, list[Operation]]:
    """Return the leftmost term of a chain of operators, and the operations from the first to the last."""
    operations: list[Operation] = []
    while isinstance(node, Operation) and node.verb in CHAINED:
        operations.append(node)
        node = node.arguments[0]
    return node, operations[::-1]


def leaves(root: Node) -> Iterator[Number | Name]:
    """Yield the numbers and names of a tree, from left to right."""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Operation):
            waiting.extend(reversed(node.arguments))
        else:
            yield node


def _is_constant(node: Node) -> bool:
    return all(isinstance(leaf, Number) for leaf in leaves(node))


class Forward:
    """One forward pass over a tree."""

    def __init__(self, columns: Mapping[str, ArrayLike], names: Sequence[str], seeds: Sequence[str]) -> None:
        missing = [name for name in names if name not in columns]
        if missing:
            raise StudyError.at("expression", missing[0], "a column", candidates=columns)
        used = dict.fromkeys(names)
        values = {name: np.atleast_1d(np.asarray(columns[name], dtype=float)) for name in used}
        self.n = max((value.size for value in values.values()), default=1)
        self.n_seeds = len(seeds)
        self.values = {name: np.broadcast_to(value, (self.n,)) for name, value in values.items()}
        self.seeds = {name: index for index, name in enumerate(seeds)}
        self.smoothing: Array | None = None
        self.kinks: dict[int, _Dual] = {}

    def run(self, root: Node) -> tuple[Array, Array]:
        """Return values (n,) and slopes (n, n_seeds) of a tree."""
        with np.errstate(all="ignore"):  # an undefined value is NaN, and the caller reports it as such
            value, slope = self.visit(root)
        return np.array(value), np.array(slope)

    def visit(self, node: Node) -> _Dual:
        """Evaluate one node and all below it."""
        if isinstance(node, Number):
            return _Dual(np.full(self.n, node.value), np.zeros((self.n, self.n_seeds)))
        if isinstance(node, Name):
            slope = np.zeros((self.n, self.n_seeds))
            if node.name in self.seeds:
                slope[:, self.seeds[node.name]] = 1.0
            return _Dual(self.values[node.name], slope)
        first, operations = chain(node)
        if operations:
            result = self.visit(first)
            for operation in operations:
                result = _RULES[operation.verb](result, self.visit(operation.arguments[1]))
            return result
        return self._operation(node)

    def _operation(self, node: Operation) -> _Dual:
        """Evaluate a function, a power or a sign."""
        arguments = [self.visit(argument) for argument in node.arguments]
        if node.verb == "**":
            return _power(arguments[0], arguments[1], constant=_is_constant(node.arguments[1]))
        if node.verb == "abs":
            return self._abs(arguments[0], node.kink)
        if node.verb in {"min", "max"}:
            result = arguments[0]
            for offset, other in enumerate(arguments[1:]):
                result = self._extreme(result, other, node.kink + offset, largest=node.verb == "max")
            return result
        return _RULES[node.verb](*arguments)

    def _soft_abs(self, argument: _Dual, kink: int) -> tuple[Array, Array]:
        """Return |t| or its smooth stand-in, and the slope of it."""
        self.kinks[kink] = argument
        t = argument.value
        if self.smoothing is None:
            return np.abs(t), np.sign(t)
        size = np.hypot(t, self.smoothing[kink])
        return size, np.divide(t, size, out=np.zeros_like(size), where=size != 0.0)

    def _abs(self, a: _Dual, kink: int) -> _Dual:
        size, slope = self._soft_abs(a, kink)
        return _Dual(size, slope[:, None] * a.slope)

    def _extreme(self, a: _Dual, b: _Dual, kink: int, *, largest: bool) -> _Dual:
        sign = 1.0 if largest else -1.0
        size, slope = self._soft_abs(_Dual(a.value - b.value, a.slope - b.slope), kink)
        if self.smoothing is None:  # the very value of one argument, and of the first one in a tie
            value = np.maximum(a.value, b.value) if largest else np.minimum(a.value, b.value)
            weight = np.where(sign * slope >= 0.0, 1.0, 0.0)[:, None]
        else:
            value = 0.5 * (a.value + b.value + sign * size)
            weight = (0.5 * (1.0 + sign * slope))[:, None]
        return _Dual(value, weight * a.slope + (1.0 - weight) * b.slope)


def _scaled(a: _Dual, value: Array, factor: Array) -> _Dual:
    return _Dual(value, factor[:, None] * a.slope)


def _product(a: _Dual, b: _Dual) -> _Dual:
    return _Dual(a.value * b.value, a.value[:, None] * b.slope + b.value[:, None] * a.slope)


def _quotient(a: _Dual, b: _Dual) -> _Dual:
    value = a.value / b.value
    return _Dual(value, (a.slope - value[:, None] * b.slope) / b.value[:, None])


def _power(a: _Dual, b: _Dual, *, constant: bool) -> _Dual:
    """Differentiate a**b; a constant exponent needs no logarithm, so that a may be 0 or negative."""
    value = a.value**b.value
    by_base = np.where(b.value == 0.0, 0.0, b.value * a.value ** (b.value - 1.0))
    if constant:
        return _scaled(a, value, by_base)
    return _Dual(value, by_base[:, None] * a.slope + (value * np.log(a.value))[:, None] * b.slope)


_RULES: Mapping[str, Callable[..., _Dual]] = {
    "+": lambda a, b: _Dual(a.value + b.value, a.slope + b.slope),
    "-": lambda a, b: _Dual(a.value - b.value, a.slope - b.slope),
    "*": _product,
    "/": _quotient,
    "neg": lambda a: _Dual(-a.value, -a.slope),
    "sqrt": lambda a: _scaled(a, np.sqrt(a.value), 0.5 / np.sqrt(a.value)),
    "exp": lambda a: _scaled(a, np.exp(a.value), np.exp(a.value)),
    "log": lambda a: _scaled(a, np.log(a.value), 1.0 / a.value),
    "sin": lambda a: _scaled(a, np.sin(a.value), np.cos(a.value)),
    "cos": lambda a: _scaled(a, np.cos(a.value), -np.sin(a.value)),
}
