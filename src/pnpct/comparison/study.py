"""What a comparison asks of all methods: plain, checked values."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from pnpct.comparison.phantoms import FURTHER_MA, Phantoms
from pnpct.geometry import DEFAULT_SIZE
from pnpct.physics import TUBE_VOLTAGE_KVP

LEAST_PAIRS = 40
"""Fewer pairs of scans give the Hotelling observer no covariance in some resample."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Doses, lesion, phantoms and seed of a comparison.

    Args:
        tube_currents_ma: Tube currents of the scans that are drawn, mA; detectability is measured at these and at 20,
            200 and 400 mA.
        tube_voltage_kvp: Tube voltage of the scans that are drawn and of the phantoms, kVp.
        size: Rows and columns of the images, for scans without a truth that fixes them.
        lesion_hu: Contrast of the lesion that is inserted into each case, HU; 0 for no lesion, in half the time.
        lesion_diameter: Diameter of the lesion, mm.
        phantom_repeats: Scans of the phantom for noise power (NPS) and resolution (TTF), at least 2; 0 omits both.
        detectability_pairs: Scans of the phantom with and without inserts per dose, at least 40; 0 omits detectability.
        phantoms: The phantoms.
        seed: Random seed.

    Raises:
        ValueError: If a number is out of its range, or inserts would be looked for at fewer than four doses.
    """

    tube_currents_ma: tuple[float, ...] = (40.0, 70.0, 100.0)
    tube_voltage_kvp: float = TUBE_VOLTAGE_KVP
    size: int = DEFAULT_SIZE
    lesion_hu: float = -40.0
    lesion_diameter: float = 12.0
    phantom_repeats: int = 8
    detectability_pairs: int = 0
    phantoms: Phantoms = Phantoms()  # noqa: RUF009 - a frozen value
    seed: int = 0

    def __post_init__(self) -> None:
        repeats, pairs, currents = self.phantom_repeats, self.detectability_pairs, self.tube_currents_ma
        if repeats < 2 and repeats != 0:
            raise ValueError(f"Noise power needs two repeats of the phantoms or more, or 0 for none: {repeats}.")
        if pairs < LEAST_PAIRS and pairs != 0:
            raise ValueError(f"Detectability needs {LEAST_PAIRS} pairs of scans or more, or 0 for none: {pairs}.")
        if not all(math.isfinite(current) and current > 0 for current in currents):
            raise ValueError(f"Tube currents must be positive, in mA, got {_listed(currents)}.")
        if pairs and len(self.doses_ma) < 4:
            raise ValueError(
                f"Detectability needs a tube current besides {_listed(FURTHER_MA)} mA, which it adds itself; got "
                f"{_listed(currents) or 'none'}."
            )
        if self.seed < 0:
            raise ValueError(f"A seed is a whole number from 0, got {self.seed}.")
        if self.size < 1:
            raise ValueError(f"An image has one row and column or more, got a size of {self.size}.")

    @property
    def doses_ma(self) -> tuple[float, ...]:
        """Tube currents at which inserts are looked for, mA, rising: beyond the full dose too."""
        return tuple(sorted({*map(float, self.tube_currents_ma), *FURTHER_MA}))

    @property
    def settings(self) -> Mapping[str, Any]:
        """All but the phantoms, as plain values."""
        return {name: value for name, value in asdict(self).items() if name != "phantoms"}


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
