"""How patients differ."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Variation:
    """Draws the sizes and places that make one patient.

    Args:
        generator: Generator of the variation.
    """

    generator: np.random.Generator

    def __call__(self, mean: float, deviation: float) -> float:
        """Draw a normal number, not farther from its mean than two standard deviations."""
        return mean + deviation * min(max(self.generator.standard_normal(), -2.0), 2.0)

    def between(self, low: float, high: float) -> float:
        """Draw a number from low to high, all of them equally likely."""
        return float(self.generator.uniform(low, high))

    def seed(self) -> int:
        """Draw the seed of something that draws for itself."""
        return int(self.generator.integers(2**31))
