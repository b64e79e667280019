"""When less noise is too little: methods that are smoother than the reference, and their place in a ranking."""

from collections.abc import Mapping

from pnpct.evaluation.texture.change import FeatureChange, TextureChange

GROWS_WITH_SMOOTHING = {
    "contrast": False,
    "dissimilarity": False,
    "homogeneity": True,
    "asm": True,
    "energy": True,
    "correlation": True,
    "entropy": False,
}
"""For each texture feature whether a blur raises it."""


def overshoots(change: FeatureChange) -> bool:
    """Whether a feature is beyond the reference on the smooth side, and farther from it than FBP (closeness < 0)."""
    if change.reference is None or change.closeness is None or change.closeness >= 0:
        return False
    return (change.method > change.reference) == GROWS_WITH_SMOOTHING[change.feature]


def oversmoothing_warnings(change: TextureChange) -> tuple[str, ...]:
    """Say in what respect a method is smoother than the reference.

    Two things count: a texture feature that overshoots the reference (`overshoots`), and `TextureChange.oversmoothed`.
    Against a reference with noise of its own even the truth is over-smooth: a warning asks for a look at contrast
    recovery and detectability, it does not replace them.

    Args:
        change: Texture of the method against FBP and the reference.

    Returns:
        One sentence for each respect; none if there is nothing to warn of.
    """
    warnings = [
        f"Over-smoothed: {each.feature} is {each.method:.3g}, beyond {each.reference:.3g} of the reference and farther "
        f"from it than {each.fbp:.3g} of FBP."
        for each in change.features
        if overshoots(each)
    ]
    if change.oversmoothed and not warnings:
        warnings.append("Over-smoothed: contrast is below, and homogeneity far above that of the reference.")
    return tuple(warnings)


def rank_by_closeness(methods: Mapping[str, TextureChange]) -> tuple[str, ...]:
    """Order methods from best to worst texture: by closeness, those that are over-smoothed behind all others.

    A constant image has the largest relative changes of all, and a blur that is matched in noise comes near the
    reference in most features; neither is first here. Methods without closeness come last.

    Args:
        methods: Texture of each method against the same FBP and reference.
    """

    def key(name: str) -> tuple[bool, bool, float]:
        change = methods[name]
        closeness = change.closeness
        return closeness is None, bool(oversmoothing_warnings(change)), 0.0 if closeness is None else -closeness

    return tuple(sorted(methods, key=key))
