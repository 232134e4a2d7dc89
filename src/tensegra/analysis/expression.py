"""Safe expressions over outputs and variables, with exact derivatives.

An objective such as ``abs(w) / (abs(v) + abs(w))`` or a constraint such as ``abs(v) <= 1`` is text in
a study file. It is read by `ast.parse` into a small tree of our own and never executed: only numbers,
known names, ``+ - * / **``, the functions in `FUNCTIONS` and, in a constraint, comparisons exist.

The tree is evaluated on whole columns in forward mode: each node carries its values (n,) and its
partial derivatives (n, n_seeds), so gradients are exact and cost one pass.

``abs``, ``min`` and ``max`` have kinks. At a kink the derivative of ``abs`` is taken as 0 and that of
``min`` and ``max`` as that of their first argument, both of them subgradients. An optimiser that must walk
through a kink passes `smoothing`, which replaces ``abs(t)`` by ``sqrt(t² + ε²)``, ``max(a, b)`` by
``(a + b + sqrt((a − b)² + ε²)) / 2`` and ``min`` likewise: smooth everywhere, and never further than ε away.
"""

import ast
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.formula import CHAINED, Forward, Name, Node, Number, Operation, chain, leaves
from tensegra.errors import StudyError, shortened

Array = NDArray[np.float64]

FUNCTIONS = ("abs", "min", "max", "sqrt", "exp", "log", "sin", "cos")

# The tension of every member of a large structure may be summed; these bounds keep a hostile formula from
# exhausting the parser. A sum or a product counts as one level, however long it is.
MAX_LENGTH = 20_000
MAX_DEPTH = 60

LONGEST_PART = 60
"""Characters of a part of a formula that a message shows."""

_OPERATORS: Mapping[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
}


@dataclass(frozen=True)
class Expression:
    """A formula over named columns.

    Attributes
    ----------
    text
        The formula as it was written.
    names
        Names that it uses, in the order of their first appearance.
    n_kinks
        How many ``abs``, ``min`` and ``max`` it holds (one per pair of arguments of the last two).

    Examples
    --------
    >>> import numpy as np
    >>> e = parse_expression("abs(w) / (abs(v) + abs(w))", ["v", "w"])
    >>> e({"v": np.array([1.0, 0.0]), "w": np.array([3.0, 2.0])})
    array([0.75, 1.  ])
    """

    text: str
    names: tuple[str, ...]
    n_kinks: int
    _root: Node

    def __call__(self, columns: Mapping[str, ArrayLike]) -> Array:
        """Return the values (n,) of the formula for `columns` of shape (n,).

        Where the formula is undefined (0/0, the root of a negative number) the value is NaN.
        """
        return self.value_and_partials(columns, seeds=())[0]

    def value_and_partials(
        self,
        columns: Mapping[str, ArrayLike],
        *,
        seeds: Sequence[str] | None = None,
        smoothing: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Return the values (n,) and the exact partial derivatives (n, n_seeds).

        Parameters
        ----------
        columns
            Values of every name in `names`, each of shape (n,) or a number.
        seeds
            Names to differentiate by; `names` unless given. A name that the formula lacks has slope 0.
        smoothing
            ε of each kink: one for all, (n_kinks,), or (n_kinks, n) for each row too; 0 or None keeps the
            kinks.
        """
        evaluator = Forward(columns, self.names, self.names if seeds is None else seeds)
        if smoothing is not None:
            widths = np.asarray(smoothing, dtype=float)
            widths = widths[:, None] if widths.ndim == 1 else widths
            evaluator.smoothing = np.broadcast_to(widths, (self.n_kinks, evaluator.n))
        return evaluator.run(self._root)

    def kink_arguments(self, columns: Mapping[str, ArrayLike]) -> Array:
        """Return what decides each kink by its sign (n_kinks, n): t of ``abs(t)``, a − b of ``max(a, b)``."""
        return self.kink_slopes(columns, seeds=())[0]

    def kink_slopes(self, columns: Mapping[str, ArrayLike], *, seeds: Sequence[str]) -> tuple[Array, Array]:
        """Return the same with the partial derivatives by `seeds`, (n_kinks, n, n_seeds)."""
        evaluator = Forward(columns, self.names, seeds)
        value, _ = evaluator.run(self._root)
        found = [evaluator.kinks[index] for index in range(self.n_kinks)]
        values = np.array([kink.value for kink in found]).reshape(self.n_kinks, value.size)
        slopes = np.array([kink.slope for kink in found])
        return values, slopes.reshape(self.n_kinks, value.size, len(seeds))

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Constraint:
    """A condition ``margin >= 0`` (or ``margin == 0`` when `equality`); one comparison can give several.

    Attributes
    ----------
    text
        The comparison as it was written.
    margin
        Expression that is positive where the condition holds with room to spare.
    equality
        Whether the margin must vanish.
    """

    text: str
    margin: Expression
    equality: bool = False


def parse_expression(text: str, names: Iterable[str], *, place: str = "expression") -> Expression:
    """Read a formula over `names`.

    Parameters
    ----------
    text
        For example ``"abs(w) / (abs(v) + abs(w))"``.
    names
        Outputs and variables that the formula may use.
    place
        Where the text stands in the study, for the error message.

    Raises
    ------
    StudyError
        If the text is not such a formula; it says where, what was found and which name comes nearest.
    """
    reader = _Reader(text, tuple(names), place)
    return reader.expression(text, reader.read(reader.body))


def parse_constraint(
    text: str, names: Iterable[str], *, counts: Iterable[str] = (), place: str = "constraint"
) -> tuple[Constraint, ...]:
    """Read a comparison such as ``abs(v) <= 1`` or ``-1 <= v <= 1`` into its smooth conditions.

    ``<`` and ``>`` mean ``<=`` and ``>=``: a number cannot tell them apart. ``abs(e) <= c`` becomes the two
    smooth conditions ``e <= c`` and ``-e <= c``; ``max(a, b) <= c`` and ``min(a, b) >= c`` are split
    likewise. An equality of nothing but `counts` and numbers, such as ``slack == 0``, means the nearest whole
    number: it becomes the two conditions ``-0.5 <= slack - 0 <= 0.5``.

    Raises
    ------
    StudyError
        If the text is not a comparison of two formulas over `names`.

    Examples
    --------
    >>> [c.margin.text for c in parse_constraint("abs(v) <= 1", ["v"])]
    ['1.0 - v', '1.0 - -v']
    """
    reader = _Reader(text, tuple(names), place)
    body = reader.body
    if not isinstance(body, ast.Compare):
        raise StudyError.at(place, text, "a comparison such as abs(v) <= 1")
    sides = [reader.read(node) for node in (body.left, *body.comparators)]
    conditions, counted = [], frozenset(counts)
    pairs: list[tuple[Node, Node]]
    for left, operator, right in zip(sides, body.ops, sides[1:], strict=False):
        equality = isinstance(operator, ast.Eq)
        if equality and _only_counts((left, right), counted):
            half, equality = Number(0.5), False
            pairs = [(left, Operation("+", (right, half))), (right, Operation("+", (left, half)))]
        elif equality:
            pairs = [(left, right)]
        elif isinstance(operator, ast.LtE | ast.Lt):
            pairs = list(_split(left, right))
        elif isinstance(operator, ast.GtE | ast.Gt):
            pairs = list(_split(right, left))
        else:
            raise StudyError.at(place, text, "one of <=, >=, ==")
        for small, large in pairs:
            margin = Operation("-", (large, small))
            label = f"{_render(large)} - {_render(small)}"
            conditions.append(Constraint(text, reader.expression(label, margin), equality))
    return tuple(conditions)


class _Reader:
    """Turn Python's syntax tree into ours, refusing all that is not arithmetic."""

    def __init__(self, text: str, names: tuple[str, ...], place: str) -> None:
        self.text, self.names, self.place = text, names, place
        if not isinstance(text, str) or not text.strip():
            raise StudyError.at(place, text, "a formula over outputs and variables")
        if len(text) > MAX_LENGTH:
            raise StudyError.at(place, f"{text[:40]}…", f"at most {MAX_LENGTH} characters")
        try:
            self.body = ast.parse(text.strip(), mode="eval").body
        except RecursionError:
            raise StudyError.at(place, text, "a formula of fewer terms, or less deeply nested") from None
        except (SyntaxError, ValueError, MemoryError) as error:
            raise StudyError.at(place, text, "a formula such as abs(w) / (abs(v) + abs(w))") from error

    def expression(self, text: str, root: Node) -> Expression:
        """Wrap a tree up: its kinks numbered, its names collected."""
        names: dict[str, None] = {}
        count = 0

        def visit(node: Node) -> Node:
            nonlocal count
            if isinstance(node, Name):
                names[node.name] = None
            if not isinstance(node, Operation):
                return node
            below, operations = chain(node)
            if operations:
                result = visit(below)
                for operation in operations:
                    result = Operation(operation.verb, (result, visit(operation.arguments[1])))
                return result
            arguments = tuple(visit(argument) for argument in node.arguments)
            first, width = (
                -1,
                {"abs": 1, "min": len(arguments) - 1, "max": len(arguments) - 1}.get(node.verb, 0),
            )
            if width:
                first, count = count, count + width
            return Operation(node.verb, arguments, first)

        tree = visit(root)
        return Expression(text.strip(), tuple(names), count, tree)

    def read(self, node: ast.expr, depth: int = 0) -> Node:
        """Convert one node and all below it."""
        if depth > MAX_DEPTH:
            raise self._refuse(node, f"at most {MAX_DEPTH} nested operations")
        if isinstance(node, ast.Constant):
            return self._number(node)
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            operand = self.read(node.operand, depth + 1)
            return operand if isinstance(node.op, ast.UAdd) else Operation("neg", (operand,))
        if isinstance(node, ast.BinOp) and _OPERATORS.get(type(node.op)) in CHAINED:
            return self._chain(node, depth)
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            sides = (self.read(node.left, depth + 1), self.read(node.right, depth + 1))
            return Operation(_OPERATORS[type(node.op)], sides)
        if isinstance(node, ast.Call):
            return self._call(node, depth)
        if isinstance(node, ast.Compare):
            raise self._refuse(node, "a formula, not a comparison")
        raise self._refuse(node, "numbers, names, + - * / ** and " + ", ".join(FUNCTIONS))

    def _chain(self, node: ast.expr, depth: int) -> Node:
        """Convert operators that are carried out from left to right, all on one level."""
        operations: list[tuple[str, ast.expr]] = []
        while isinstance(node, ast.BinOp) and (verb := _OPERATORS.get(type(node.op))) in CHAINED:
            operations.append((str(verb), node.right))
            node = node.left
        result = self.read(node, depth + 1)
        for verb, right in reversed(operations):
            result = Operation(verb, (result, self.read(right, depth + 1)))
        return result

    def _number(self, node: ast.Constant) -> Number:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise self._refuse(node, "a number")
        try:
            value = float(node.value)
        except OverflowError as error:
            raise self._refuse(node, "a finite number") from error
        if not np.isfinite(value):
            raise self._refuse(node, "a finite number")
        return Number(value)

    def _name(self, node: ast.Name) -> Name:
        if node.id not in self.names:
            known = ", ".join(self.names) or "none"
            raise StudyError.at(
                f"{self.place} '{self.text}'",
                node.id,
                f"an output or a variable ({known})",
                candidates=(*self.names, *FUNCTIONS),
            )
        return Name(node.id)

    def _call(self, node: ast.Call, depth: int) -> Operation:
        if not isinstance(node.func, ast.Name) or node.func.id not in FUNCTIONS:
            source = ast.get_source_segment(self.text.strip(), node.func) or self.text
            found = node.func.id if isinstance(node.func, ast.Name) else shortened(source, LONGEST_PART)
            expected = "one of the functions " + ", ".join(FUNCTIONS)
            raise StudyError.at(f"{self.place} '{self.text}'", found, expected, candidates=FUNCTIONS)
        verb = node.func.id
        several = verb in {"min", "max"}
        if node.keywords or (len(node.args) < 2 if several else len(node.args) != 1):
            raise self._refuse(node, f"{verb} of " + ("two or more arguments" if several else "one argument"))
        return Operation(verb, tuple(self.read(argument, depth + 1) for argument in node.args))

    def _refuse(self, node: ast.expr, expected: str) -> StudyError:
        # Not unparsed: that calls itself for each term.
        found = ast.get_source_segment(self.text.strip(), node) or self.text
        return StudyError.at(f"{self.place} '{self.text}'", shortened(found, LONGEST_PART), expected)


def _only_counts(sides: Iterable[Node], counts: frozenset[str]) -> bool:
    """Tell whether trees hold counts and numbers only, and at least one count."""
    names = {leaf.name for side in sides for leaf in leaves(side) if isinstance(leaf, Name)}
    return bool(names) and names <= counts


def _split(small: Node, large: Node) -> Iterable[tuple[Node, Node]]:
    """Split ``small <= large`` into conditions without the kinks that a split can remove."""
    if isinstance(small, Operation) and small.verb == "abs":
        inner = small.arguments[0]
        yield from ((inner, large), (Operation("neg", (inner,)), large))
    elif isinstance(small, Operation) and small.verb == "max":
        for argument in small.arguments:
            yield from _split(argument, large)
    elif isinstance(large, Operation) and large.verb == "min":
        for argument in large.arguments:
            yield from _split(small, argument)
    else:
        yield small, large


def _render(node: Node) -> str:
    """Write a tree as text again, fully bracketed below the first level."""
    if isinstance(node, Number):
        return repr(node.value)
    if isinstance(node, Name):
        return node.name
    first, operations = chain(node)
    if operations:
        text = _render(first)
        for operation in operations:
            text = f"({text} {operation.verb} {_render(operation.arguments[1])})"
        return text
    parts = [_render(argument) for argument in node.arguments]
    if node.verb == "neg":
        return f"-{parts[0]}"
    if node.verb in FUNCTIONS:
        return f"{node.verb}({', '.join(parts)})"
    return f"({parts[0]} {node.verb} {parts[1]})"
