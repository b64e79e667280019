"""The JSON schema of a comparison: `metrics.json` as frozen records."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from pnpct.evaluation import Detectability, Interval, LesionRecovery, Patch, TextureChange
from pnpct.files import Provenance
from pnpct.geometry import ImageGrid

Verdict: TypeAlias = Literal["pass", "fail", "not judged"]
Observer: TypeAlias = Literal["channelised Hotelling", "NPWE"]
"""The first measures dose; the second rewards blurring, and is shown beside the control only."""

Role: TypeAlias = Literal["baseline", "control", "swept", "compared"]
"""The baseline is FBP, which all others are measured against; the control is blurred FBP, which must not win; of a
swept method it is shown what only its prior vouches for."""

Numbers: TypeAlias = Mapping[str, Mapping[str, Mapping[str, float | None]]]
"""By case, by method (or what the case has besides), by name of the number; None where it does not exist."""


@dataclass(frozen=True)
class ComparedMethod:
    """One way from a scan to an image.

    Args:
        name: What it is called in all tables, and its images in the folder.
        label: What readers see.
        role: What it is there for.
        settings: All that its images depend on besides the data, as plain values.
    """

    name: str
    label: str
    role: Role
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class StoredImage:
    """An image in the folder of the comparison.

    Args:
        file: Its path from the folder, an image as `pnpct.files.read_image` reads it.
        sha256: Of its pixels and grid, in hexadecimal: it changes when one pixel does.
        seconds: What it took to make; None where that means nothing.
    """

    file: str
    sha256: str
    seconds: float | None = None


@dataclass(frozen=True)
class Detail:
    """A square that is shown enlarged: first row, first column, side in pixels; chosen before any result was seen."""

    row: int
    col: int
    size: int


@dataclass(frozen=True)
class Case:
    """One scan, and its images.

    Args:
        name: What it is called in all tables.
        label: What readers see, say "chest, 40 mA".
        tube_current_ma: Tube current; None where it is not known.
        tube_voltage_kvp: Peak tube voltage; None where it is not known.
        grid: Of all its images.
        geometry: The scan's geometry in words.
        details: Squares to enlarge.
        images: By method; "truth" and "reference" (the scan at high dose, noisy too) where they exist.
        maps: By method, then by what they show: "t", the score test; "verifiable_hu", the least contrast that the data
            can confirm, one map for all methods; "difference_hu", what the prior has changed. Stored like images, but
            in the unit of their name. Outside the body all are 0, as where no verifiable contrast is known.
        seed: Of the noise, None where it is measured.
        patches: Where texture was measured; none where there is no soft tissue for it.
        texture_spec_hash: `GLCMSpec.hash` of how these were chosen and measured; None where there are none.
        disc_mm: Diameter of the discs of the score test, mm; None where it was not made.
    """

    name: str
    label: str
    tube_current_ma: float | None
    tube_voltage_kvp: float | None
    grid: ImageGrid
    geometry: str
    details: tuple[Detail, ...]
    images: Mapping[str, StoredImage]
    maps: Mapping[str, Mapping[str, StoredImage]] = field(default_factory=dict)
    seed: int | None = None
    patches: tuple[Patch, ...] = ()
    texture_spec_hash: str | None = None
    disc_mm: float | None = None


@dataclass(frozen=True)
class TextureGroup:
    """What the methods did to the texture of the scans at one tube current.

    Args:
        patients: How many there are; below five no change has an interval.
        patches: How many there are, over all their scans.
        changes: By method, its changes from the baseline.
        ranking: The methods, best first: by closeness to the reference, what is over-smoothed behind all others.
    """

    patients: int
    patches: int
    changes: Mapping[str, TextureChange]
    ranking: tuple[str, ...]


@dataclass(frozen=True)
class Curve:
    """A function of frequency.

    Args:
        kind: "noise-power" in HU² mm², or "transfer" (no unit, 1 at frequency 0).
        method: Whose.
        what: Of what, in words: "200 mm of water at 100 mA", "disc of −40 HU at 100 mA".
        frequency_per_mm: Where, 1/mm.
        values: The function there.
        summary: Numbers taken from it: "mean_frequency_per_mm", "f50_per_mm", "f10_per_mm".
    """

    kind: Literal["noise-power", "transfer"]
    method: str
    what: str
    frequency_per_mm: tuple[float, ...]
    values: tuple[float, ...]
    summary: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class DosePoint:
    """How well an observer finds a lesion at one tube current."""

    tube_current_ma: float
    found: Detectability


@dataclass(frozen=True)
class DoseShare:
    """The share of the reference's dose at which a method detects as well, 1 being no saving.

    Args:
        reference: Method and tube current of the d′ to reach, in words.
        share: The share of its dose; the lowest or highest dose that was measured is a bound.
        outside: "below" if the method detects as well already at the lowest dose that was measured, "above" if it
            does not even at the highest; None if the share was found between.
    """

    reference: str
    share: Interval
    outside: Literal["below", "above"] | None = None


@dataclass(frozen=True)
class Task:
    """One lesion, one method, one observer.

    Args:
        method: Whose images.
        observer: Who looks for it.
        lesion: The lesion in words, "10 mm, −15 HU".
        points: By tube current.
        equal_dose: What it means for dose; None where it could not be computed.
    """

    method: str
    observer: Observer
    lesion: str
    points: tuple[DosePoint, ...]
    equal_dose: DoseShare | None = None


@dataclass(frozen=True)
class LeastReduction:
    """What a method saves whichever the lesion: the largest share of dose over all lesions.

    Args:
        method: Whose images.
        observer: That of the tasks.
        lesion: The lesion that needs this share, in words.
        equal_dose: The share; its interval is that of the largest over the lesions, not of this lesion alone.
    """

    method: str
    observer: Observer
    lesion: str
    equal_dose: DoseShare


@dataclass(frozen=True)
class Check:
    """One question about an image, and its answer.

    Args:
        name: What is checked: "residual chi-square", "largest score", "lesion recovery" ...
        case: Where; None if it is about all.
        method: Of what; None if it is about all.
        value: The number; None where it could not be had.
        low: Lower end of what passes; None where it has none.
        high: Upper end; None where it has none.
        verdict: "fail" is shown first and cannot be hidden.
        says: One sentence for readers.
    """

    name: str
    case: str | None
    method: str | None
    value: float | None
    low: float | None
    high: float | None
    verdict: Verdict
    says: str


@dataclass(frozen=True)
class Comparison:
    """All that a comparison has found.

    Args:
        provenance: Command, version, seed, fingerprints of inputs and networks.
        definitions: What numbers mean: the GLCM's definition with its hash, windows, tissue bins, observers.
        methods: As they are shown, one of them the baseline.
        cases: As they are shown.
        fidelity: Errors against the truth, by names with units: "rmse_hu", "psnr_40_400" (level and width of its
            window) ... None of these without truth.
        texture: GLCM features; "reference" is a scan at 800 mA, "repeat" a second one, and "truth" has no noise.
        texture_change: By tube current ("40 mA"), the change from the baseline over its cases, against the reference.
        histogram: Distances from the reference, "emd" on the axis from 0 to 1 and "emd_hu"; the same from the truth,
            "emd_to_truth" and "emd_to_truth_hu"; and of the reference "repeat_scan_floor".
        curves: Noise power and transfer.
        tasks: Detectability against dose.
        lesions: By case and method, what is left of a lesion that was put into the data.
        checks: All that was checked.
        least_reductions: By method, what it saves in all tasks; missing where a task has no equal dose.
    """

    provenance: Provenance
    definitions: Mapping[str, Any]
    methods: tuple[ComparedMethod, ...]
    cases: tuple[Case, ...]
    fidelity: Numbers = field(default_factory=dict)
    texture: Numbers = field(default_factory=dict)
    texture_change: Mapping[str, TextureGroup] = field(default_factory=dict)
    histogram: Numbers = field(default_factory=dict)
    curves: tuple[Curve, ...] = ()
    tasks: tuple[Task, ...] = ()
    lesions: Mapping[str, Mapping[str, LesionRecovery]] = field(default_factory=dict)
    checks: tuple[Check, ...] = ()
    least_reductions: tuple[LeastReduction, ...] = ()

    def __repr__(self) -> str:
        methods, cases = ("; ".join(each.label for each in of) for of in (self.methods, self.cases))
        failed = sum(check.verdict == "fail" for check in self.checks)
        return f"<Comparison: {methods}; on {cases}; {len(self.checks)} checks, {failed} failed>"
