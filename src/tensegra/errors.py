"""Errors that tensegra raises, and the wording that they share.

A bad input is answered with one message that says where it is, what was found, what was expected
and which known name comes nearest. A numerical failure is a status, never an exception, unless the
caller asks for one (`raise_for_status`).
"""

import reprlib
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Self

LONGEST_FOUND, LONGEST_PLACE, LONGEST_PHRASE = 200, 400, 1200
"""Characters of a message that a value found, its place and what was expected may take: a value of a
hundred thousand is told by its beginning and its end, a list of a thousand names by its beginning."""

_MEANINGS: dict[str, str] = {
    # samplers
    "latin_hypercube": "lhs lhc lhsmdu latin latin_hypercube_sampling",
    "sobol": "random mc monte_carlo montecarlo uniform lds low_discrepancy quasi_random qmc",
    "full_factorial": "grid factorial fullfact regular",
    "monte_carlo": "mc montecarlo random",
    "quasi_monte_carlo": "qmc sobol halton lhs",
    # surrogates
    "gpr": "kriging gp gaussian_process gaussian_process_regression gaussianprocess krg",
    "nn": "neural_network ann mlp network dnn neural_net",
    "pce": "polynomial_chaos chaos polynomial_chaos_expansion polynomial response_surface",
    # laws
    "normal": "gaussian norm gauss",
    "truncated_normal": "truncnorm truncated_gaussian",
    "lognormal": "log_normal lognorm",
    "discrete": "categorical choice",
    "empirical": "kde histogram data samples",
    "same_as": "copy equals tied",
    # analyses and their methods
    "propagation": "uq uncertainty monte_carlo uncertainty_propagation forward",
    "sensitivity": "sobol gsa saltelli sobol_indices global_sensitivity",
    "morris": "screening elementary_effects ee",
    "optimisation": "optimization optimize optimise opt minimize",
    "inverse": "reach control inverse_kinematics ik",
    "calibration": "bayes mcmc inference identification",
    "robust": "rbdo reliability robust_optimisation robust_optimization",
    "slsqp": "sqp nlp",
    "bayesian": "bo ego bayesopt",
    # structures
    "strut": "bar rod compression beam truss",
    "cable": "tendon string wire tie tension rope",
    "nodes": "points vertices joints coordinates",
    "members": "elements edges bars connectivity",
    "supports": "fixed boundary constraints fixities bcs fixity",
    "stages": "steps history load_cases",
    "youngs_modulus": "e young modulus elastic_modulus youngs",
    "thermal_expansion": "alpha cte",
    "weight": "density rho unit_weight specific_weight",
    "stiffness": "ea axial_stiffness",
    "rest_length": "l0 unstressed_length natural_length initial_length",
    "area": "a cross_section section",
    "strength": "yield yield_strength max_force capacity",
    "actuator": "control input",
    "shorten": "contract pull retract",
    "lengthen": "extend elongate release",
}
"""What things are called here, and what other programs call them."""

OTHER_WORDS: dict[str, list[str]] = {}
for _meant, _words in _MEANINGS.items():
    for _word in _words.split():
        OTHER_WORDS.setdefault(_word, []).append(_meant)

LONGEST_NAME = 100
"""Characters of a name that is compared with known ones; longer ones are no misspelling of any."""

_repr = reprlib.Repr()
_repr.maxstring = _repr.maxother = _repr.maxlong = LONGEST_FOUND
_repr.maxlist = _repr.maxtuple = _repr.maxdict = _repr.maxset = _repr.maxfrozenset = _repr.maxarray = 24


class TensegraError(Exception):
    """Base of every error that tensegra raises on purpose."""

    @classmethod
    def at(
        cls,
        place: str,
        found: object,
        expected: str,
        *,
        candidates: Iterable[object] = (),
    ) -> Self:
        """Build the error from its four parts.

        Parameters
        ----------
        place
            Where the fault is: a file and a path of keys such as ``members.K1.nodes[2]``.
        found
            The offending value, shown as it was written.
        expected
            What would have been right, as a phrase.
        candidates
            Known names; the one nearest to `found` is offered as a correction.

        Examples
        --------
        >>> print(ModelError.at("members.K1.kind", "cabel", "a kind", candidates=["cable", "strut"]))
        members.K1.kind: found 'cabel', expected a kind; did you mean 'cable'?
        """
        where, wanted = shortened(place, LONGEST_PLACE), shortened(expected, LONGEST_PHRASE)
        message = f"{where}: found {shown(found)}, expected {wanted}"
        match = nearest(found, candidates)
        if match is not None:
            message += f"; did you mean {match!r}?"
        return cls(message)


class ModelError(TensegraError):
    """A structure, or a change to one, that cannot be: unknown names, impossible values."""


class SolverError(TensegraError):
    """A numerical failure that the caller asked to be raised instead of reported as a status."""


class StudyError(TensegraError):
    """A study, a campaign or an analysis that cannot be carried out as it is written."""


def shown(value: object) -> str:
    """Return a value as it is written in Python, in at most a line or two.

    Examples
    --------
    >>> shown("beam"), shown([1, "a"]), len(shown("a" * 100_000))
    ("'beam'", "[1, 'a']", 200)
    """
    try:
        return shortened(_repr.repr(value), LONGEST_FOUND)
    except (ValueError, RecursionError):  # a whole number of too many digits; lists within lists
        return f"<{type(value).__name__}>"


def shortened(text: str, most: int) -> str:
    """Return a text of at most `most` characters, its middle left out where it is longer.

    Examples
    --------
    >>> shortened("abcdefghij", 7)
    'ab...ij'
    """
    if len(text) <= most:
        return text
    kept = (most - 3) // 2
    return f"{text[: most - 3 - kept]}...{text[-kept:]}"


def nearest(name: object, candidates: Iterable[object]) -> str | None:
    """Return the candidate that `name` was most likely meant to be, or None.

    Words that other programs use for the same thing are looked up first.

    Examples
    --------
    >>> nearest("alumnium", ["aluminium", "steel"])
    'aluminium'
    >>> nearest("wood", ["aluminium", "steel"]) is None
    True
    >>> nearest("kriging", ["gpr", "nn", "pce"]), nearest("LHS", ["sobol", "latin_hypercube"])
    ('gpr', 'latin_hypercube')
    """
    if len(str(name)) > LONGEST_NAME:
        return None
    known = {str(candidate): None for candidate in candidates}
    for meant in OTHER_WORDS.get(str(name).lower().replace("-", "_").replace(" ", "_"), ()):
        if meant in known:
            return meant
    folded = {candidate.lower(): candidate for candidate in known}
    matches = get_close_matches(str(name).lower(), folded, n=1, cutoff=0.6)
    return folded[matches[0]] if matches else None
