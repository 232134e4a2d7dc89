"""What stands beside the code: texts below the fields of a model, and the parameters of a docstring."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable
from typing import Any

from pydantic import BaseModel

__all__ = ["described_fields", "described_parameters"]


def described_fields(model: type[BaseModel]) -> dict[str, str]:
    """Return the text below each field of a model, those that it inherits included.

    Read from the source: pydantic can do it, too, but then for every model at each start.
    """
    texts: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if not issubclass(base, BaseModel) or base is BaseModel:
            continue
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        assert isinstance(tree, ast.ClassDef)  # noqa: S101 — it is a class
        for field, below in zip(tree.body, tree.body[1:], strict=False):
            match field, below:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                    texts[name] = " ".join(text.split())
    return texts


def described_parameters(function: Callable[..., Any]) -> dict[str, str]:
    """Return the description of each parameter in a docstring of NumPy's style.

    Examples
    --------
    >>> described_parameters(described_parameters)["function"]
    'What is described.'

    Parameters
    ----------
    function
        What is described.
    """
    section = re.search(r"Parameters\n-+\n(.*?)(?:\n\n\w|\Z)", inspect.getdoc(function) or "", re.DOTALL)
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in (section[1] if section else "").splitlines():
        if line and not line.startswith(" "):
            names = [name.strip() for name in line.split(",")]
        else:
            for name in names:
                texts[name] = f"{texts.get(name, '')} {line.strip()}".strip()
    return texts
