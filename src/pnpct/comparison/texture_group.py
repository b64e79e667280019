"""What the methods did to the texture of all scans at one tube current."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pnpct.evaluation import FeatureChange, Texture, rank_by_closeness, texture_change


@dataclass(frozen=True)
class TextureGroup:
    """What the methods did to the texture at one tube current.

    Args:
        patients: How many there are; below five no change has an interval.
        patches: How many there are, over all their scans.
        spec_hash: `GLCMSpec.hash` of the definition.
        changes: By method, its changes from FBP, one for each feature.
        ranking: The methods, best first: by closeness to the reference, what is over-smoothed behind all others.
    """

    patients: int
    patches: int
    spec_hash: str
    changes: Mapping[str, tuple[FeatureChange, ...]]
    ranking: tuple[str, ...]


def texture_group(
    scans: Sequence[Mapping[str, Texture]], patients: Sequence[str], methods: Sequence[str], *, seed: int
) -> TextureGroup:
    """Compare the texture of methods with FBP and the reference, over the scans of one tube current.

    Args:
        scans: For each scan its texture by method, and of the "reference" where there is one; at least one scan.
        patients: Whose scan it is.
        methods: Names of the methods, FBP first.
        seed: Of the bootstrap.

    Raises:
        ValueError: If the textures are of different definitions.
    """
    first, *others = methods
    known = all("reference" in scan for scan in scans)
    changes = {
        name: texture_change(
            [scan[name] for scan in scans],
            [scan[first] for scan in scans],
            [scan["reference"] for scan in scans] if known else None,
            generator=np.random.default_rng(seed),
            cases=patients,
        )
        for name in others
    }
    return TextureGroup(
        len(set(patients)),
        sum(len(scan[first].patches) for scan in scans),
        scans[0][first].spec_hash,
        {name: change.features for name, change in changes.items()},
        rank_by_closeness(changes),
    )
