"""The JSON Schemas that are shipped: written by `tensegra.schemas.generate`, read as they are."""

from importlib.resources import files

from tensegra.errors import TensegraError

__all__ = ["NAMES", "schema_text"]

NAMES = ("structure", "study")


def schema_text(name: str) -> str:
    """Return the JSON Schema of a format as text.

    Parameters
    ----------
    name
        ``structure`` or ``study``.

    Raises
    ------
    TensegraError
        There is no such format.
    """
    if name not in NAMES:
        raise TensegraError.at("schema", name, f"one of {', '.join(NAMES)}", candidates=NAMES)
    return (files("tensegra.schemas") / f"{name}.schema.json").read_text(encoding="utf-8")
