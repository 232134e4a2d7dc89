"""YAML and JSON text, to and from plain values: safely, and without losing a repeated key."""

import json
import re
from collections.abc import Hashable
from functools import cache
from typing import TYPE_CHECKING, Any

from tensegra.errors import shown
from tensegra.structure.bounded import DEEPEST, TextError, require_plain

if TYPE_CHECKING:
    import yaml

__all__ = ["REPEATED", "TextError", "dump_json", "dump_line", "dump_yaml", "load_json", "load_yaml"]

MOST_MERGED = 100_000
"""Keys that `<<` may bring into one mapping: each level of aliases multiplies them."""


class _Repeated:
    """Stands for the value of a key that a mapping has twice."""

    def __repr__(self) -> str:
        return "a key that is there twice"


REPEATED = _Repeated()

# YAML 1.2 has these plain scalars; YAML 1.1, which PyYAML reads, takes 1e6 for a text, 010 for 8,
# 1:30 for 90 and `no` for false.
_SCALARS = {
    "tag:yaml.org,2002:null": (r"~|null|Null|NULL|", [*"~nN", ""]),
    "tag:yaml.org,2002:bool": (r"true|True|TRUE|false|False|FALSE", [*"tTfF"]),
    "tag:yaml.org,2002:int": (r"[-+]?[0-9]+", [*"-+0123456789"]),
    "tag:yaml.org,2002:float": (
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        [*"-+.0123456789"],
    ),
    "tag:yaml.org,2002:merge": (r"<<", ["<"]),
}


def load_yaml(text: str) -> object:
    """Read YAML by the safe loader, with the scalars of YAML 1.2.

    Raises
    ------
    TextError
        `text` is not YAML, or asks for more than plain values.

    Examples
    --------
    >>> load_yaml("{a: 1e6, b: no, 1: 010, a: 2}")
    {'a': a key that is there twice, 'b': 'no', 1: 10}
    """
    import yaml

    try:
        _require_shallow(text)
        value = yaml.load(text, Loader=_loader())  # noqa: S506 — a subclass of the safe loader
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise TextError(f"{where}{shown(error.problem or error.context)[1:-1]}") from None
    except TextError:
        raise
    except (yaml.YAMLError, ValueError) as error:
        raise TextError(_one_line(error)) from None
    # PyYAML's constructors trust a tag such as !!bool or !!timestamp to stand before what it says.
    except (LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        raise TextError(f"a value is not what its tag says ({_one_line(error)})") from None
    require_plain(value, _Repeated)
    return value


def load_json(text: str) -> object:
    """Read JSON.

    Raises
    ------
    TextError
        `text` is not JSON.

    Examples
    --------
    >>> load_json('{"a": 1, "a": 2}')
    {'a': a key that is there twice}
    """
    try:
        value = json.loads(text, object_pairs_hook=_mapping_of)
    except json.JSONDecodeError as error:
        raise TextError(f"line {error.lineno}, column {error.colno}: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise TextError(_one_line(error)) from None
    require_plain(value, _Repeated)
    return value


def dump_yaml(value: object) -> str:
    """Write plain values as YAML that versions 1.1 and 1.2 read alike, one short entry a line."""
    import yaml

    return yaml.dump(
        value, Dumper=_dumper(), sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )


def dump_line(value: object) -> str:
    """Write a plain value as YAML on one line.

    Examples
    --------
    >>> dump_line({"kind": "cable", "nodes": ["1", "5"], "rest_length": 300.0})
    "{kind: cable, nodes: ['1', '5'], rest_length: 300.0}"
    """
    import yaml

    text = yaml.dump(
        value,
        Dumper=_dumper(),
        sort_keys=False,
        allow_unicode=True,
        default_flow_style=True,
        width=float("inf"),
    )
    return text.removesuffix("\n").removesuffix("\n...")


def dump_json(value: object) -> str:
    """Write plain values as JSON."""
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _one_line(error: Exception) -> str:
    return "nested too deeply" if isinstance(error, RecursionError) else " ".join(str(error).split())


def _require_shallow(text: str) -> None:
    """Refuse a text nested so deeply that libyaml, which calls itself for each level, would crash."""
    import yaml

    depth = 0
    for event in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > DEEPEST:
                line = event.start_mark.line + 1 if event.start_mark else "?"
                raise TextError(f"line {line}: nested more than {DEEPEST} lists and mappings deep")
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _mapping_of(pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
    mapping: dict[Any, Any] = {}
    for key, value in pairs:
        mapping[key] = REPEATED if key in mapping else value
    return mapping


@cache
def _loader() -> "type[yaml.SafeLoader]":
    import yaml

    class Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
        yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012 — as PyYAML has it

        def flatten_mapping(self, node: Any) -> None:  # noqa: ANN401
            super().flatten_mapping(node)
            if len(node.value) > MOST_MERGED:
                raise TextError(f"found more than {MOST_MERGED} merged keys in one mapping, expected fewer")

        def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:  # noqa: ANN401
            own = [key for key, _ in node.value if key.tag != "tag:yaml.org,2002:merge"]
            mapping: dict[Hashable, Any] = super().construct_mapping(node, deep=deep)
            seen: set[Hashable] = set()
            for key_node in own:
                key = self.construct_object(key_node, deep=deep)
                if key in seen:
                    mapping[key] = REPEATED
                seen.add(key)
            return mapping

    for tag, (pattern, first) in _SCALARS.items():
        Loader.add_implicit_resolver(tag, re.compile(rf"(?:{pattern})\Z"), first)
    # Decimal whatever the leading zeros; PyYAML's own constructor reads 010 as octal.
    Loader.add_constructor("tag:yaml.org,2002:int", lambda loader, node: int(loader.construct_scalar(node)))
    return Loader


@cache
def _dumper() -> "type[yaml.SafeDumper]":
    import yaml

    class Dumper(yaml.SafeDumper):
        def ignore_aliases(self, data: object) -> bool:  # noqa: ARG002 — every value is written out
            return True

    def represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
        # In any other style PyYAML folds these line breaks of Unicode into plain ones.
        style = '"' if {"\x85", "\u2028", "\u2029"} & set(text) else None
        return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)

    Dumper.add_representer(str, represent_text)
    for tag, (pattern, first) in _SCALARS.items():
        Dumper.add_implicit_resolver(tag, re.compile(rf"(?:{pattern})\Z"), first)
    return Dumper
