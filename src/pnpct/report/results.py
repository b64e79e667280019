"""A comparison as a page shows it: what each method is called, its colour, and the order in which methods stand."""

import re
from dataclasses import dataclass
from functools import cached_property
from statistics import fmean

import msgspec

from pnpct.comparison import Case, Comparison
from pnpct.report.environment import text_of
from pnpct.report.images import GIVEN, columns, labels
from pnpct.report.marked_numbers import Numbers

TOKENS: dict[str, str] = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", text_of("tokens.css")))
"""The colours of the light page by their names."""

METHOD_COLOURS = 8
"""So many colours there are; more methods share them, and are told apart by their names."""

ERRORS = ("body_rmse_hu", "soft_tissue_rmse_hu", "rmse_hu")
"""Errors by which methods are put in order; the first that a comparison has is taken."""


@dataclass(frozen=True)
class Results:
    """A comparison with all that its sections share.

    Args:
        comparison: The comparison.
    """

    comparison: Comparison

    @cached_property
    def numbers(self) -> Numbers:
        """The content of `metrics.json`."""
        return Numbers(msgspec.to_builtins(self.comparison))

    @cached_property
    def labels(self) -> dict[str, str]:
        """What readers see for each method, the reference, its repeat and the truth; a control is called one."""
        suffix = dict.fromkeys(self.controls, " (control)")
        return {name: label + suffix.get(name, "") for name, label in labels(self.comparison).items()}

    def label(self, method: str) -> str:
        """What readers see for a method, which the comparison need not list."""
        return self.labels.get(method, method)

    @cached_property
    def cases(self) -> dict[str, str]:
        """What readers see for each case."""
        return {case.name: case.label for case in self.comparison.cases}

    @cached_property
    def controls(self) -> frozenset[str]:
        """The methods that must not win."""
        return frozenset(method.name for method in self.comparison.methods if method.role == "control")

    @cached_property
    def baseline(self) -> str | None:
        """The method that the others are measured against; None if there is none."""
        return next((method.name for method in self.comparison.methods if method.role == "baseline"), None)

    @cached_property
    def error(self) -> str | None:
        """The error that tells which method is best; None where no truth is known."""
        found = {name for of in self.comparison.fidelity.values() for values in of.values() for name in values}
        return next((name for name in ERRORS if name in found), None)

    @cached_property
    def best(self) -> str | None:
        """The method with the least mean error over the cases, controls left out; without a truth the last one."""
        names = [m.name for m in self.comparison.methods if m.name not in {*self.controls, self.baseline}]
        names = names or [method.name for method in self.comparison.methods]
        errors = {name: values for name in names if (values := self._errors(name))}
        return min(errors, key=lambda name: fmean(errors[name])) if errors else next(reversed(names), None)

    @cached_property
    def methods(self) -> tuple[str, ...]:
        """All methods: the best, then the others as they were compared, the controls last."""
        names = [method.name for method in self.comparison.methods]
        return tuple(sorted(names, key=lambda name: (name in self.controls, name != self.best)))

    @cached_property
    def styles(self) -> dict[str, str]:
        """Classes of each method, of the reference, its repeat and the truth: a colour, the same everywhere."""
        found = {m.name: f"c{n % METHOD_COLOURS} role-{m.role}" for n, m in enumerate(self.comparison.methods)}
        return {**found, "reference": "c-given", "repeat": "c-given", "truth": "c-given dotted"}

    @cached_property
    def method_styles(self) -> tuple[tuple[str, str], ...]:
        """Label and classes of each method, in the order of the page."""
        return tuple((self.labels[name], self.styles[name]) for name in self.methods)

    @cached_property
    def legend(self) -> tuple[tuple[str, str], ...]:
        """The same, with what the cases have besides."""
        given = [name for name in GIVEN if any(name in case.images for case in self.comparison.cases)]
        return (*self.method_styles, *((self.labels[name], self.styles[name]) for name in given))

    def style(self, method: str) -> str:
        """Classes of a method, empty for one that the comparison does not list."""
        return self.styles.get(method, "")

    def colour(self, method: str) -> str:
        """The colour of a method on the light page."""
        return TOKENS.get(self.style(method).partition(" ")[0], TOKENS["quiet"])

    def order(self, case: Case) -> list[str]:
        """The images of a case as a page has them: what is trusted most beside the best method, then the others."""
        found = columns(self.comparison, case)
        given = [name for name in reversed(GIVEN) if name in found]
        return [*given[:1], *(name for name in self.methods if name in found), *given[1:]]

    def _errors(self, method: str) -> list[float]:
        of_method = (values.get(method, {}).get(self.error or "") for values in self.comparison.fidelity.values())
        return [error for error in of_method if error is not None]
