"""What the generators share: members that carry a wanted tension, and refusals of impossible numbers."""

from math import inf

from tensegra.errors import ModelError
from tensegra.structure.parts import Kind, Member

__all__ = ["require_count", "require_positive", "stressed_member"]


def stressed_member(
    kind: Kind, path: tuple[str, ...], length: float, tension: float, stiffness: float, *groups: str
) -> Member:
    """Return the member that carries `tension` at `length`: its rest length is ℓ / (1 + T / EA).

    Parameters
    ----------
    kind, path, stiffness, groups
        As for `Member`; `stiffness` is EA, a force.
    length
        Length of the whole path as drawn.
    tension
        Positive for tension, a force; zero for a member without prestress.

    Raises
    ------
    ModelError
        A compression of EA or more, under which no length is left.
    """
    stretch = 1.0 + tension / stiffness
    if stretch <= 0.0:
        raise ModelError.at(
            f"prestress from {path[0]} to {path[-1]}",
            tension,
            f"more than {-stiffness:g}: the member keeps no length under it",
        )
    return Member(kind, path, length / stretch, stiffness=stiffness, groups=groups)


def require_positive(place: str, **numbers: float) -> None:
    """Refuse the first number that is not finite and greater than zero.

    Raises
    ------
    ModelError
        With `place` and the number's name.
    """
    for name, number in numbers.items():
        if not 0.0 < number < inf:
            raise ModelError.at(f"{place}: {name}", number, "a finite number greater than 0")


def require_count(place: str, least: int, **counts: int) -> None:
    """Refuse the first count that is less than `least`.

    Raises
    ------
    ModelError
        With `place` and the count's name.
    """
    for name, count in counts.items():
        if count < least:
            raise ModelError.at(f"{place}: {name}", count, f"at least {least}")
