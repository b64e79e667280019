"""Classes of colours: each method has one, the same everywhere on a page."""

from pnpct.comparison import Comparison

COLOURS = 8
"""So many colours there are; more methods share them, and are told apart by their names."""


def styles_of(comparison: Comparison) -> dict[str, str]:
    """Return the classes of each method, of the reference, its repeat and the truth."""
    by_method = {
        method.name: f"c{index % COLOURS} role-{method.role}" for index, method in enumerate(comparison.methods)
    }
    return {**by_method, "reference": "c-reference", "repeat": "c-reference", "truth": "c-truth"}
