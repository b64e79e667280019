"""How far each method is from the truth, on scans that took no part in training.

    python benchmarks/quality.py FOLDER [--cases abdomen,chest,head,pelvis,catsim-chest] [--doses 40,70,100]
        [--n2n n2n] [--supervised supervised] [--red-cnn RED-CNN.safetensors] [--seed 0] [--patients 900]

Prints for every case and dose, in HU: RMSE in soft tissue and in the body, bias in uniform soft tissue, the share of
a lesion of 12 mm and -40 HU that is kept (difference of two scans with the same noise), and for plug-and-play the
RMSE after all iterations over that after the best number of them, in soft tissue and in the body; last the mean over
the cases. FBP has the kernel, the blur its width and total variation its strength with the least RMSE in soft tissue
of this very scan: an oracle that the learned methods do not have. The folder gets the exposures of the cases, the
images as .h5 and .png, and the rows as .json, with the errors of every choice; they are not measured again. Take
another folder for another network, seed or version, or for other patients.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import torch

from pnpct.arrays import Image
from pnpct.denoisers import Denoise, Gaussian
from pnpct.evaluation import bias_hu, body_mask, rmse_hu, soft_tissue_mask
from pnpct.files import load_denoiser, record_run, write_image
from pnpct.operators import Projector
from pnpct.physics import Exposure, Scan, take_log
from pnpct.reconstruction import FBP, TVPWLS, ADMMState, DenoisedFBP, Method, PlugAndPlay
from pnpct.units import to_hu
from quality_cases import CONTRAST_HU, PATIENTS, QualityCase, cases

KERNELS = ("ram-lak", "shepp-logan", "hann", "soft")
WIDTHS = tuple(width / 4 for width in range(3, 15))
STRENGTHS = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0)

Row = dict[str, Any]
Rows = dict[str, Row]


class Judge:
    """Measures the methods on one case at one dose."""

    def __init__(self, case: QualityCase, dose: float, folder: Path, seed: int) -> None:
        self.case, self.dose, self.folder, self.seed = case, dose, folder, seed
        self.truth = case.plain.truth
        self.soft, self.body = soft_tissue_mask(self.truth), body_mask(self.truth)
        exposures = [case.plain.exposure, *([case.lesion.exposure] if case.lesion else [])]
        scans = [self.scan(exposure) for exposure in exposures]
        self.A = Projector(case.plain.grid, scans[0].geometry, mu_water=scans[0].mu_water)
        self.sinograms = [take_log(scan) for scan in scans]

    def scan(self, exposure: Exposure) -> Scan:
        generator = torch.Generator().manual_seed(1000 * self.seed + int(self.dose))
        return exposure.scan(tube_current_ma=self.dose, generator=generator)

    def errors(self, image: Image) -> tuple[float, float]:
        return rmse_hu(image, self.truth, mask=self.soft), rmse_hu(image, self.truth, mask=self.body)

    def best(self, name: str, choices: dict[str, Method]) -> Row:
        """Judge the choice with the least RMSE in soft tissue."""
        images = {choice: method(self.sinograms[0], self.A).image for choice, method in choices.items()}
        errors = {choice: self.errors(image) for choice, image in images.items()}
        choice = min(errors, key=errors.__getitem__)  # in soft tissue first
        return {**self.row(name, choices[choice], images[choice]), "note": choice, "choices": errors}

    def loop(self, name: str, denoise: Denoise) -> Row:
        """Judge plug-and-play, and how much worse it is after all iterations than after the best number of them."""
        errors: list[tuple[float, float]] = []

        def watched(states: Iterator[ADMMState], _most: int) -> Iterable[ADMMState]:
            for state in states:
                errors.append(self.errors(state.v))
                yield state

        method = PlugAndPlay(denoise)
        image = method(self.sinograms[0], self.A, progress=watched).image
        shares = [of_mask[-1] / min(of_mask) for of_mask in zip(*errors, strict=True)]
        note = "after {} iterations {:.3f} and {:.3f} of the least errors".format(len(errors), *shares)
        return {**self.row(name, method, image), "note": note}

    def row(self, name: str, method: Method, image: Image | None = None) -> Row:
        image = method(self.sinograms[0], self.A).image if image is None else image
        kept = None
        if len(self.sinograms) == 2:
            change = to_hu(method(self.sinograms[1], self.A).image) - to_hu(image)
            kept = 100 * float(change[self.case.core].mean()) / CONTRAST_HU
        path = self.folder / f"{self.case.name}-{self.dose:g}mA-{name.replace(',', '').replace(' ', '-')}"
        for suffix in (".png", ".h5"):
            write_image(f"{path}{suffix}", image, self.case.plain.grid, provenance=record_run(sys.argv, seed=self.seed))
        soft, body = self.errors(image)
        bias = bias_hu(image, self.truth, mask=self.case.uniform)
        return {"soft tissue": soft, "body": body, "bias": bias, "lesion kept": kept, "note": ""}


def judge(
    case: QualityCase, dose: float, folder: Path, networks: dict[str, Denoise], *, seed: int, classical: bool
) -> Rows:
    """Return the rows of one case at one dose, and keep them in the folder."""
    file = folder / f"{case.name}-{dose:g}mA.json"
    rows: Rows = json.loads(file.read_text()) if file.exists() else {}
    judged = Judge(case, dose, folder, seed)
    work: dict[str, Callable[[str], Row]] = {}
    if classical:
        work["FBP"] = partial(judged.best, choices={kernel: FBP(kernel) for kernel in KERNELS})
        blurs = {f"{width:g} pixels": DenoisedFBP(Gaussian(width)) for width in WIDTHS}
        work["blurred FBP"] = partial(judged.best, choices=blurs)
        strengths = {f"{strength:g} pixels": TVPWLS(strength) for strength in STRENGTHS}
        work["TV-PWLS"] = partial(judged.best, choices=strengths)
    for name, denoise in networks.items():
        work[name] = partial(judged.row, method=DenoisedFBP(denoise))
        if name != "RED-CNN":
            work[f"PnP {name}"] = partial(judged.loop, denoise=denoise)
    for name, measure in work.items():
        if name not in rows:
            rows[name] = measure(name)
            file.write_text(json.dumps(rows, indent=1))
        say(case.name, dose, name, rows[name])
    return rows


def say(case: str, dose: float, name: str, row: Row) -> None:
    numbers = [f"{row['soft tissue']:.1f}", f"{row['body']:.1f}", f"{row['bias']:+.1f}"]
    kept = "-" if row["lesion kept"] is None else f"{row['lesion kept']:.0f} %"
    print("| " + " | ".join([case, f"{dose:g}", name, *numbers, kept, row["note"]]) + " |", flush=True)


def means(rows: list[Rows]) -> Rows:
    """The mean of each method over the cases; of the lesion over those that have one."""
    found: Rows = {}
    for name in rows[0]:
        found[name] = {"note": f"{len(rows)} cases"}
        for column in ("soft tissue", "body", "bias", "lesion kept"):
            numbers = [row[name][column] for row in rows if row[name][column] is not None]
            found[name][column] = sum(numbers) / len(numbers) if numbers else None
    return found


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--cases", default="abdomen,chest,head,pelvis,catsim-chest")
    options.add_argument("--doses", default="40,70,100")
    options.add_argument("--n2n", default="n2n", help="two-stage network; empty for none")
    options.add_argument("--supervised", default="supervised")
    options.add_argument("--red-cnn", default="")
    options.add_argument("--seed", type=int, default=0, help="of the noise")
    options.add_argument("--patients", type=int, default=PATIENTS, help="seed of the procedural ones")
    options.add_argument("--no-classical", action="store_true", help="networks alone")
    given = options.parse_args()
    files = {"RED-CNN": given.red_cnn, "supervised": given.supervised, "two-stage": given.n2n}
    networks = {name: load_denoiser(file) for name, file in files.items() if file}
    print("| case | mA | method | soft tissue | body | bias | lesion kept | |\n|---|---|---|---|---|---|---|---|")
    doses = [float(dose) for dose in given.doses.split(",")]
    rows: dict[float, list[Rows]] = {dose: [] for dose in doses}
    what = {"seed": given.seed, "classical": not given.no_classical}
    for case in cases(given.folder, given.cases.split(","), given.patients):
        truth = given.folder / f"{case.name}-truth.h5"
        write_image(truth, case.plain.truth, case.plain.grid, provenance=record_run(sys.argv))
        for dose in doses:
            rows[dose].append(judge(case, dose, given.folder, networks, **what))
    for dose, of_cases in rows.items():
        for name, row in means(of_cases).items():
            say("mean", dose, name, row)


if __name__ == "__main__":
    main()
