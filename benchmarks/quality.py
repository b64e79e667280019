"""How far each method is from the truth, on scans that took no part in training.

    python benchmarks/quality.py FOLDER [--cases abdomen,chest,head,pelvis,large-abdomen,child,catsim-chest]
        [--doses 20,40,100] [--iterations 20] [--n2n n2n] [--supervised supervised] [--red-cnn RED-CNN.safetensors]
        [--seed 0] [--patients 900] [--blur]

Prints for every case and dose, in HU, of two scans with noise of their own: RMSE in soft tissue and in the body, bias
in uniform soft tissue, and the share of a lesion of 12 mm and -40 HU that is kept (difference of two scans with the
same noise); last the mean over the cases. FBP has the kernel, the blur its width and total variation its strength with
the least RMSE in soft tissue of these very scans: an oracle that the learned methods do not have. Plug-and-play has the
most that its noise, the difference of the two scans, has over that of total variation in any of eight rings of
frequency, and with --iterations its RMSE after four, five and the last of them over that of the best. The folder
gets the exposures of the cases, the images of the first scans as .h5 and .png, and the rows as .json, with the errors
of every choice; they are not measured again. Take another folder for another network, seed or version, for other
patients, or for scans that focal spot, cells and rotation blur (--blur).
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
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
from pnpct.reconstruction.iteration_schedule import FEWEST
from pnpct.units import to_hu
from quality_cases import CONTRAST_HU, PATIENTS, QualityCase, cases

KERNELS = ("ram-lak", "shepp-logan", "hann", "soft")
WIDTHS = tuple(width / 4 for width in range(3, 15))
STRENGTHS = (1.0, 1.5, 2.25)
RINGS = 8
REST = {"bias": "{:+.1f}", "lesion kept": "{:.0f} %"}

Row = dict[str, Any]
Rows = dict[str, Row]


class Judge:
    """Measures the methods on two scans of one case at one dose."""

    def __init__(self, case: QualityCase, dose: float, folder: Path, seed: int) -> None:
        self.case, self.dose, self.folder, self.seed = case, dose, folder, seed
        shape = (2, *case.plain.grid.shape)
        self.truth = case.plain.truth.expand(shape)
        self.soft, self.body = (mask(case.plain.truth).expand(shape) for mask in (soft_tissue_mask, body_mask))
        exposures = [case.plain.exposure, *([case.lesion.exposure] if case.lesion else [])]
        scans = [self.scans(exposure) for exposure in exposures]
        self.A = Projector(case.plain.grid, scans[0].geometry, mu_water=scans[0].mu_water)
        self.sinograms = [take_log(scan) for scan in scans]
        self.first = take_log(replace(scans[0], counts=scans[0].counts[0]))

    def scans(self, exposure: Exposure) -> Scan:
        seeds = [1000 * (self.seed + repeat) + int(self.dose) for repeat in range(2)]
        drawn = [
            exposure.scan(tube_current_ma=self.dose, generator=torch.Generator().manual_seed(seed)) for seed in seeds
        ]
        return replace(drawn[0], counts=torch.stack([scan.counts for scan in drawn]))

    def errors(self, image: Image) -> tuple[float, float]:
        """RMSE of the two scans, or of the first, in soft tissue and in the body."""
        of = slice(0, len(image))
        return tuple(rmse_hu(image, self.truth[of], mask=mask[of]) for mask in (self.soft, self.body))

    def best(self, name: str, choices: dict[str, Method]) -> Row:
        """Judge the choice with the least RMSE in soft tissue."""
        images = {choice: method(self.sinograms[0], self.A).image for choice, method in choices.items()}
        errors = {choice: self.errors(image) for choice, image in images.items()}
        choice = min(errors, key=errors.__getitem__)  # in soft tissue first
        return {**self.row(name, choices[choice], images[choice]), "note": choice, "choices": errors}

    def loop(self, _name: str, method: PlugAndPlay) -> Row:
        """Judge plug-and-play after each iteration, of the first scan."""
        errors: list[tuple[float, float]] = []

        def watched(states: Iterator[ADMMState], _most: int) -> Iterable[ADMMState]:
            for state in states:
                errors.append(self.errors(_surrounded(state.v, self.truth.shape[-2:])[None]))
                yield state

        method(self.first, self.A, progress=watched)
        least = [min(of_mask) for of_mask in zip(*errors, strict=True)]
        after = sorted({FEWEST, 5, len(errors)})
        notes = [
            f"after {number} " + " / ".join(f"{e / b:.3f}" for e, b in zip(errors[number - 1], least, strict=True))
            for number in after
        ]
        soft, body = errors[-1]
        note = ", ".join(notes) + " of the least errors"
        return {"soft tissue": soft, "body": body, "bias": None, "lesion kept": None, "note": note, "all": errors}

    def row(self, name: str, method: Method, image: Image | None = None) -> Row:
        image = method(self.sinograms[0], self.A).image if image is None else image
        kept = None
        if len(self.sinograms) == 2 and not isinstance(method, TVPWLS):
            change = to_hu(method(self.sinograms[1], self.A).image) - to_hu(image)
            kept = 100 * float(change[:, self.case.core].mean()) / CONTRAST_HU
        path = self.folder / f"{self.case.name}-{self.dose:g}mA-{name.replace(',', '').replace(' ', '-')}"
        record = record_run(sys.argv, seed=self.seed)
        for suffix in (".png", ".h5"):
            write_image(f"{path}{suffix}", image[0], self.case.plain.grid, provenance=record)
        soft, body = self.errors(image)
        bias = bias_hu(image, self.truth, mask=self.case.uniform.expand_as(image))
        row = {"soft tissue": soft, "body": body, "bias": bias, "lesion kept": kept, "note": ""}
        return {**row, "noise": [self.noise(image, mask[0]) for mask in (self.soft, self.body)]}

    def noise(self, image: Image, mask: torch.Tensor) -> list[float]:
        """Power of the noise in rings of frequency up to that of Nyquist, HU²: what the two scans differ by."""
        noise = (to_hu(image[0]) - to_hu(image[1])) / 2**0.5 * mask
        power = torch.fft.fft2(noise).abs().square() / mask.sum()
        frequency = torch.hypot(torch.fft.fftfreq(noise.shape[0])[:, None], torch.fft.fftfreq(noise.shape[1]))
        ring = (frequency / 0.5 * RINGS).long()
        return [float(power[ring == number].mean()) for number in range(RINGS)]


def _surrounded(image: Image, shape: tuple[int, ...]) -> Image:
    """An iterate, which leaves out air around the object, in the middle of a whole image."""
    rows, cols = ((whole - part) // 2 for whole, part in zip(shape, image.shape, strict=True))
    return torch.nn.functional.pad(image, (cols, cols, rows, rows))


def judge(
    case: QualityCase, dose: float, folder: Path, networks: dict[str, Denoise], *, seed: int, classical: bool, most: int
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
            work[f"PnP {name}"] = partial(judged.row, method=PlugAndPlay(denoise))
            if most:
                method = PlugAndPlay(denoise, iterations=most, stop="never")
                work[f"PnP {name}, {most} iterations"] = partial(judged.loop, method=method)
    for name, measure in work.items():
        if name not in rows:
            rows[name] = measure(name)
            file.write_text(json.dumps(rows, indent=1))
        say(case.name, dose, name, rows[name] | {"note": rows[name]["note"] or louder(rows, name)})
    return rows


def louder(rows: Rows, name: str) -> str:
    """Say how much more noise a method has than total variation in any ring of frequency, at most."""
    if "noise" not in rows.get("TV-PWLS", {}):
        return ""
    of_masks = zip(rows[name]["noise"], rows["TV-PWLS"]["noise"], strict=True)
    most = [max(mine / its for mine, its in zip(*rings, strict=True)) for rings in of_masks]
    return "noise at most {:.2f} and {:.2f} times that of total variation".format(*most)


def say(case: str, dose: float, name: str, row: Row) -> None:
    numbers = [f"{row['soft tissue']:.1f}", f"{row['body']:.1f}"]
    numbers += ["-" if row[of] is None else form.format(row[of]) for of, form in REST.items()]
    print("| " + " | ".join([case, f"{dose:g}", name, *numbers, row["note"]]) + " |", flush=True)


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
    options.add_argument("--cases", default="abdomen,chest,head,pelvis,large-abdomen,child,catsim-chest")
    options.add_argument("--doses", default="20,40,100")
    options.add_argument("--iterations", type=int, default=0, help="to watch plug-and-play for; 0 is not at all")
    options.add_argument("--n2n", default="n2n", help="two-stage network; empty for none")
    options.add_argument("--supervised", default="supervised")
    options.add_argument("--red-cnn", default="")
    options.add_argument("--seed", type=int, default=0, help="of the noise")
    options.add_argument("--patients", type=int, default=PATIENTS, help="seed of the procedural ones")
    options.add_argument("--blur", action="store_true", help="of focal spot, cells and rotation")
    options.add_argument("--no-classical", action="store_true", help="networks alone")
    given = options.parse_args()
    files = {"RED-CNN": given.red_cnn, "supervised": given.supervised, "two-stage": given.n2n}
    networks = {name: load_denoiser(file) for name, file in files.items() if file}
    print("| case | mA | method | soft tissue | body | bias | lesion kept | |\n|---|---|---|---|---|---|---|---|")
    doses = [float(dose) for dose in given.doses.split(",")]
    rows: dict[float, list[Rows]] = {dose: [] for dose in doses}
    what = {"seed": given.seed, "classical": not given.no_classical, "most": given.iterations}
    for case in cases(given.folder, given.cases.split(","), given.patients, blur=given.blur):
        truth = given.folder / f"{case.name}-truth.h5"
        write_image(truth, case.plain.truth, case.plain.grid, provenance=record_run(sys.argv))
        for dose in doses:
            rows[dose].append(judge(case, dose, given.folder, networks, **what))
    for dose, of_cases in rows.items():
        for name, row in means(of_cases).items():
            say("mean", dose, name, row)


if __name__ == "__main__":
    main()
