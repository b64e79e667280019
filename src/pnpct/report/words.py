"""How names and numbers are spelled for readers."""

import math
import re
from collections.abc import Iterable, Sequence

_UNITS = {"hu": "HU", "db": "dB", "mm": "mm", "ma": "mA", "kvp": "kVp", "s": "s", "percent": "%"}
_CAPITALS = {
    "rmse",
    "psnr",
    "ssim",
    "emd",
    "asm",
    "fbp",
    "hu",
    "nps",
    "ttf",
    "glcm",
    "sha256",
    "ldctbench",
    "lodopab",
    "fr",
    "npw",
    "npwe",
    "cho",
}
_SPELLED = {"ldctbench": "ldct-bench", "lodopab": "LoDoPaB", "sha256": "SHA-256"}


def title_of(name: str) -> str:
    """Turn a name like soft_tissue_rmse_hu into words, without its unit; two numbers at its end are a window.

    Example:
        >>> title_of("soft_tissue_rmse_hu"), unit_of("soft_tissue_rmse_hu"), title_of("psnr_40_400")
        ('Soft tissue RMSE', 'HU', 'PSNR, window 40/400')
    """
    words = re.split(r"[_\s-]+", _without_unit(name)[0])
    spelled = [_SPELLED.get(word, word.upper() if word in _CAPITALS else word) for word in words]
    text = re.sub(r" (\d+) (\d+)$", r", window \1/\2", " ".join(spelled))
    return text[:1].upper() + text[1:]


def unit_of(name: str) -> str:
    """Return the unit that a name ends in, for readers; nothing if it names none."""
    return _without_unit(name)[1]


def common_decimals(values: Iterable[float | None], *, digits: int = 4) -> int | None:
    """Return how many digits behind the point a column of numbers should have.

    The largest has `digits` significant digits, and so has every number at least two.

    Returns:
        From 0 to 6; None if the numbers are too different for one answer.

    Example:
        >>> common_decimals([121.4, 63.9, 8.8]), common_decimals([0.5, 0.0004])
        (1, None)
    """
    sizes = [abs(value) for value in values if value]
    if not sizes:
        return 0
    decimals = digits - 1 - math.floor(math.log10(max(sizes)))
    wide = max(sizes) >= 100 * min(sizes) and min(sizes) * 10.0**decimals < 10
    return None if wide or decimals > 6 else max(0, decimals)


def spell_exactly(value: float) -> str:
    """Write a number that somebody has chosen: with all its digits and no others.

    Example:
        >>> spell_exactly(120.0), spell_exactly(-0.35)
        ('120', '−0.35')
    """
    return f"{value:.12g}".replace("-", "−")


def _without_unit(name: str) -> tuple[str, str]:
    stem, _, last = name.rpartition("_")
    if not stem or last not in _UNITS:
        return name, ""
    if stem.endswith("_per"):
        return stem.removesuffix("_per"), f"1/{_UNITS[last]}"
    return stem, _UNITS[last]


def spell(value: float, *, digits: int = 3, decimals: int | None = None, signed: bool = False) -> str:
    """Write a number with so many significant digits, and never fewer than all before the point.

    Args:
        value: A finite number.
        digits: Significant digits, at least 1.
        decimals: Digits behind the point instead, from 0 to 6.
        signed: Whether a positive number gets its sign too.

    Example:
        >>> spell(0.012345), spell(-12345.6), spell(2.5, signed=True), spell(0.0)
        ('0.0123', '−12\u202f346', '+2.50', '0')
    """
    if value == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    behind = max(0, digits - 1 - magnitude) if decimals is None else decimals
    text = f"{value:.{digits - 1}e}" if magnitude < -5 and decimals is None else f"{value:.{behind}f}"
    if abs(value) >= 10_000:
        text = f"{value:,.0f}".replace(",", "\u202f")
    sign = "+" if signed and value > 0 else ""
    return sign + text.replace("-", "−")


def listed(words: Sequence[str]) -> str:
    """Join words as a sentence does.

    Example:
        >>> listed(["a", "b", "c"])
        'a, b and c'
    """
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))
