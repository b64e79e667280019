"""Where the contrast medium is, some time after it was injected into a vein of the arm."""

from dataclasses import dataclass

from pnpct.simulation.anatomy.variation import Variation


@dataclass(frozen=True)
class Contrast:
    """How much of each tissue is blood with 10 mg/ml of iodine, some time after the injection.

    Args:
        arteries, portal, veins: Share in the blood of the arteries, the portal system and the other veins.
        liver, spleen, cortex, medulla, pancreas, wall: Share in the organs, the two parts of the kidneys and the
            wall of the bowel.
    """

    arteries: float = 0.0
    portal: float = 0.0
    veins: float = 0.0
    liver: float = 0.0
    spleen: float = 0.0
    cortex: float = 0.0
    medulla: float = 0.0
    pancreas: float = 0.0
    wall: float = 0.0


_ARTERIAL = Contrast(0.85, 0.22, 0.12, 0.06, 0.26, 0.55, 0.10, 0.27, 0.17)
_PORTAL_VENOUS = Contrast(0.40, 0.44, 0.34, 0.19, 0.25, 0.50, 0.36, 0.22, 0.14)


def drawn_contrast(vary: Variation) -> Contrast:
    """Draw a time and a dose: no contrast medium in one of six patients, mostly near the portal venous phase."""
    time, dose = vary.between(0, 1) ** 0.4, vary(1.0, 0.12)
    if vary.between(0, 1) < 1 / 6:
        return Contrast()
    pairs = zip(vars(_ARTERIAL).values(), vars(_PORTAL_VENOUS).values(), strict=True)
    return Contrast(*(dose * ((1 - time) * early + time * late) for early, late in pairs))
