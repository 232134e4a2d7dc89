"""The law of a member: its tension T(ℓ, l₀) with derivatives and energy; no other file knows them.

Every function is plain arithmetic, so it serves for floats, for arrays and, compiled, for packs of lanes.
Each speaks of a member that carries force; whether one does (`carries`) is a state of its own, which the
solver keeps. The linear law is T = EA (ℓ − l₀)/l₀, a cable carries max(0, T): (M2) of the theory, its
derivatives (D2).

Compiled code calls the functions as they stand; Python calls them through `plain`, without compiling.

Symbols: ℓ path length, l₀ effective rest length, EA axial stiffness; a dot is d/dλ along a path.
"""

from types import SimpleNamespace

from tensegra.mechanics.compiled import njit


@njit
def tension(length, rest_length, stiffness):
    """T = EA (ℓ − l₀)/l₀, unit of force."""
    return stiffness / rest_length * (length - rest_length)


@njit
def by_length(length, rest_length, stiffness):  # noqa: ARG001 - of a linear law it is the same everywhere
    """∂T/∂ℓ = EA/l₀, the axial stiffness k in K, force per length."""
    return stiffness / rest_length


@njit
def by_rest_length(length, rest_length, stiffness):
    """∂T/∂l₀ = −EA ℓ/l₀², force per length."""
    return (0.0 - stiffness) / rest_length * (length / rest_length)


@njit
def by_stiffness(length, rest_length):
    """∂T/∂EA = (ℓ − l₀)/l₀, a strain."""
    return (length - rest_length) / rest_length


@njit
def rate(length, rest_length, stiffness, length_rate, rest_length_rate):
    """Ṫ = k (ℓ̇ − ℓ/l₀ l̇₀), force."""
    return stiffness / rest_length * (length_rate - length / rest_length * rest_length_rate)


@njit
def bend(length, rest_length, stiffness, length_rate, rest_length_rate, rest_length_bend):
    """T̈ − k ℓ̈ = −k (ℓ/l₀ l̈₀ + 2 l̇₀/l₀ (ℓ̇ − ℓ/l₀ l̇₀)): what bends T where ℓ goes on straight, force."""
    ratio = length / rest_length
    turn = 2.0 * (rest_length_rate / rest_length) * (length_rate - ratio * rest_length_rate)
    return (0.0 - stiffness) / rest_length * (ratio * rest_length_bend + turn)


@njit
def energy(length, rest_length, stiffness):
    """Strain energy ∫ T dℓ = ½ EA (ℓ − l₀)²/l₀, force times length."""
    stretch = length - rest_length
    return 0.5 * stiffness / rest_length * stretch * stretch


@njit
def size(length, rest_length, stiffness):
    """EA ℓ/l₀: times the relative rounding of a length it is the rounding of T, force."""
    return stiffness / rest_length * length


@njit
def rest_length_for(length, tension, stiffness):
    """Return the rest length with which a member of length ℓ carries T."""
    return length / (1.0 + tension / stiffness)


plain = SimpleNamespace(
    **{
        kernel.__name__: kernel.py_func
        for kernel in (
            *(tension, by_length, by_rest_length, by_stiffness),
            *(rate, bend, energy, size, rest_length_for),
        )
    }
)
"""The same functions for floats and arrays."""
