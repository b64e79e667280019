"""What a comparison has found, as frozen records and as `metrics.json`; the report shows nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import msgspec

from pnpct.comparison.case_record import Case
from pnpct.comparison.texture_group import TextureGroup
from pnpct.files import FileFormatError, Provenance, atomic_path

RESULTS = "metrics.json"
"""Name of the file in the folder of a comparison."""

FORMAT = "pnpct-comparison"

Verdict = Literal["pass", "fail", "not judged"]

Numbers = Mapping[str, Mapping[str, Mapping[str, float | None]]]
"""By case, by method (or what the case has besides), by name of the number; None where it does not exist."""


@dataclass(frozen=True)
class Method:
    """One way from a scan to an image.

    Args:
        name: What it is called in all tables, and its images in the folder.
        label: What readers see.
        kind: "control" is what must not win: blurred FBP.
        settings: All that it depends on, as plain values.
    """

    name: str
    label: str
    kind: Literal["fbp", "control", "denoiser", "iterative", "plug-and-play"]
    settings: Mapping[str, Any] = field(default_factory=dict)


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
    """How well an observer finds a lesion at one tube current, with its 95 % interval."""

    tube_current_ma: float
    d_prime: float
    low: float
    high: float
    auc: float


@dataclass(frozen=True)
class DoseShare:
    """The share of the reference's dose at which a method detects as well, 1 being no saving.

    Nothing is read beyond the doses that were measured: an end of the interval that is one of them is a bound.

    Args:
        reference: Method and tube current that set the mark, in words.
        share: The share of its dose, or the bound that `outside` speaks of; None where it is not known.
        low: Lower end of the 95 % interval; None where it is not known.
        high: Upper end; None where it is not known.
        outside: "below" if the method detects as well already at the lowest dose that was measured, "above" if it
            does not even at the highest; None if the share was found between.
    """

    reference: str
    share: float | None
    low: float | None
    high: float | None
    outside: Literal["below", "above"] | None = None


@dataclass(frozen=True)
class Task:
    """One lesion, one method, one observer.

    Args:
        method: Whose images.
        observer: "channelised Hotelling" decides; "NPWE" rewards blurring and is shown beside the control only.
        lesion: The lesion in words, "10 mm, −15 HU".
        points: By tube current.
        equal_dose: What it means for dose; None where it could not be computed.
    """

    method: str
    observer: Literal["channelised Hotelling", "NPWE"]
    lesion: str
    points: tuple[DosePoint, ...]
    equal_dose: DoseShare | None = None


@dataclass(frozen=True)
class LeastReduction:
    """What a method saves whichever the lesion: the largest share of dose over all lesions.

    Args:
        method: Whose images.
        observer: That of the tasks.
        lesion: The lesion that needs the largest share, in words.
        equal_dose: That share; its interval is that of the largest over the lesions, not of this lesion alone.
    """

    method: str
    observer: Literal["channelised Hotelling", "NPWE"]
    lesion: str
    equal_dose: DoseShare


@dataclass(frozen=True)
class LesionResult:
    """What became of a lesion that was put into the data of a case.

    Args:
        case: Which case.
        method: Which method.
        lesion: The lesion in words.
        contrast_hu: The contrast that was put in, HU.
        recovered: Share of it in the image, 1 being all.
        spill: Mean change in a ring around it, as share of the contrast.
        distant_hu: RMS change more than 20 mm away, HU.
    """

    case: str
    method: str
    lesion: str
    contrast_hu: float
    recovered: float
    spill: float
    distant_hu: float


@dataclass(frozen=True)
class Check:
    """One question that honesty asks, and its answer.

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
        methods: In the order in which they are shown; the first is the FBP that others are measured against.
        cases: In the order in which they are shown.
        fidelity: Errors against the truth, by names with units: "rmse_hu", "soft_tissue_rmse_hu", "psnr_40_400" (level
            and width of its window) ... None of these without truth.
        texture: GLCM features, their absolute values; "reference" is a scan at 800 mA, "repeat" a second one, and
            "truth" has no noise.
        texture_change: By tube current ("40 mA"), the change from FBP over its cases, against the reference.
        histogram: Distances from the reference, "emd" on the axis from 0 to 1 and "emd_hu"; the same from the truth,
            "emd_to_truth" and "emd_to_truth_hu"; and of the reference "repeat_scan_floor".
        curves: Noise power and transfer.
        tasks: Detectability against dose.
        lesions: Lesions put into the data.
        checks: Honesty checks.
        least_reductions: By method, what it saves in all tasks; missing where a task has no equal dose.
    """

    provenance: Provenance
    definitions: Mapping[str, Any]
    methods: tuple[Method, ...]
    cases: tuple[Case, ...]
    fidelity: Numbers = field(default_factory=dict)
    texture: Numbers = field(default_factory=dict)
    texture_change: Mapping[str, TextureGroup] = field(default_factory=dict)
    histogram: Numbers = field(default_factory=dict)
    curves: tuple[Curve, ...] = ()
    tasks: tuple[Task, ...] = ()
    lesions: tuple[LesionResult, ...] = ()
    checks: tuple[Check, ...] = ()
    least_reductions: tuple[LeastReduction, ...] = ()


def write_comparison(folder: Path, comparison: Comparison) -> None:
    """Write `metrics.json` into the folder of a comparison.

    Raises:
        OSError: If the file cannot be written.
    """
    content = {"format": FORMAT, "format_version": 1, **msgspec.to_builtins(comparison)}
    with atomic_path(folder / RESULTS) as temporary:
        temporary.write_bytes(msgspec.json.format(msgspec.json.encode(content), indent=1) + b"\n")


def read_comparison(folder: Path) -> Comparison:
    """Read `metrics.json` from the folder of a comparison.

    Raises:
        OSError: If there is none or it cannot be read.
        FileFormatError: If it is something else.
    """
    path = folder / RESULTS
    content = path.read_bytes()
    try:
        found = msgspec.json.decode(content)
        if not isinstance(found, dict) or found.pop("format", None) != FORMAT:
            raise FileFormatError(f"{path} is not what a comparison writes.")
        return msgspec.convert(found, Comparison)
    except msgspec.MsgspecError as error:
        raise FileFormatError(f"{path} is not what a comparison writes: {error}.") from error
