"""How far each method is from the truth, on scans that took no part in training.

    python benchmarks/quality.py FOLDER [--cases abdomen,chest,head,pelvis,catsim-chest] [--doses 40,70,100]
        [--n2n n2n] [--supervised supervised] [--red-cnn RED-CNN.safetensors]

Prints for every case and dose, in HU: RMSE in soft tissue and in the body, bias in uniform soft tissue, the share of
a lesion of 12 mm and -40 HU that is kept (difference of two scans with the same noise), and the time of one slice.
FBP has the kernel, the blur its width and total variation its strength with the least RMSE in soft tissue of this
very scan: an oracle that the learned methods do not have. Then, for plug-and-play, the RMSE of 20 iterations over
that of the best. Images and their pictures go to the folder, which also keeps the exposures of the cases.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import torch

from pnpct.arrays import Image
from pnpct.denoisers import Denoise, Gaussian, as_denoiser
from pnpct.evaluation import bias_hu, body_mask, rmse_hu, soft_tissue_mask
from pnpct.files import load_network, network_file, record_run, write_image
from pnpct.operators import Projector
from pnpct.physics import Exposure, Sinogram, take_log
from pnpct.reconstruction import ADMMState, fbp, pnp_admm, tv_pwls, until
from pnpct.units import to_hu
from quality_cases import CONTRAST_HU, QualityCase, cases

KERNELS = ("ram-lak", "shepp-logan", "hann", "soft")
WIDTHS = tuple(width / 4 for width in range(3, 15))
STRENGTHS = (0.05, 0.08, 0.12, 0.18)
ITERATIONS = 20

Method = Callable[[Sinogram, Projector], Image]


def start(sinogram: Sinogram, A: Projector) -> ADMMState:
    return ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))


def total_variation(strength: float) -> Method:
    def make(sinogram: Sinogram, A: Projector) -> Image:
        first = start(sinogram, A)
        *_, last = until(tv_pwls(sinogram, A, first, strength=strength), first, iterations=ITERATIONS)
        return last.v

    return make


def plug_and_play(denoise: Denoise, watch: Callable[[Image], None] = lambda _: None) -> Method:
    def make(sinogram: Sinogram, A: Projector) -> Image:
        states = pnp_admm(sinogram, A, denoise, start(sinogram, A))
        for _ in range(ITERATIONS):
            state = next(states)
            watch(state.v)
        return state.v

    return make


def sharp(sinogram: Sinogram, A: Projector) -> Image:
    return fbp(sinogram.line_integrals, A, kernel="ram-lak")


def blurred(width: float) -> Method:
    blur = Gaussian(width)
    return lambda sinogram, A: blur(sharp(sinogram, A))


class Judge:
    """Measures the methods on one case at one dose."""

    def __init__(self, case: QualityCase, dose: float, folder: Path) -> None:
        self.case, self.dose, self.folder = case, dose, folder
        self.truth = case.plain.truth
        self.soft, self.body = soft_tissue_mask(self.truth), body_mask(self.truth)
        exposures = [case.plain.exposure, *([case.lesion.exposure] if case.lesion else [])]
        scans = [self.scan(exposure) for exposure in exposures]
        self.A = Projector(case.plain.grid, scans[0].geometry, mu_water=scans[0].mu_water)
        self.sinograms = [take_log(scan) for scan in scans]

    def scan(self, exposure: Exposure):
        return exposure.scan(tube_current_ma=self.dose, generator=torch.Generator().manual_seed(int(self.dose)))

    def rmse(self, image: Image) -> float:
        return rmse_hu(image, self.truth, mask=self.soft)

    def best(self, name: str, choices: dict[str, Method]) -> None:
        """Write the row of the choice with the least RMSE."""
        images = {choice: method(self.sinograms[0], self.A) for choice, method in choices.items()}
        choice = min(images, key=lambda choice: self.rmse(images[choice]))
        self.row(name, choices[choice], choice, image=images[choice])

    def row(self, name: str, method: Method, note: str = "", image: Image | None = None) -> None:
        began = time.perf_counter()
        image = method(self.sinograms[0], self.A) if image is None else image
        seconds = time.perf_counter() - began
        kept = "-"
        if len(self.sinograms) == 2:
            change = to_hu(method(self.sinograms[1], self.A)) - to_hu(image)
            kept = f"{100 * float(change[self.case.core].mean()) / CONTRAST_HU:.0f} %"
        bias = bias_hu(image, self.truth, mask=self.case.uniform)
        body = rmse_hu(image, self.truth, mask=self.body)
        print(
            f"| {self.case.name} | {self.dose:g} | {name} | {self.rmse(image):.1f} | {body:.1f} | {bias:+.1f} | {kept} "
            f"| {seconds:.1f} | {note} |",
            flush=True,
        )
        path = self.folder / f"{self.case.name}-{self.dose:g}mA-{name.replace(' ', '-')}"
        for suffix in (".png", ".h5"):
            write_image(f"{path}{suffix}", image, self.case.plain.grid, provenance=record_run(sys.argv))


def judge(case: QualityCase, dose: float, folder: Path, networks: dict[str, Denoise], *, classical: bool) -> None:
    judged = Judge(case, dose, folder)
    if classical:
        kernels = {kernel: (lambda y, A, kernel=kernel: fbp(y.line_integrals, A, kernel=kernel)) for kernel in KERNELS}
        judged.best("FBP", kernels)
        judged.best("blurred FBP", {f"{width:g} pixels": blurred(width) for width in WIDTHS})
        judged.best("TV-PWLS", {f"strength {1000 * each:g}": total_variation(each) for each in STRENGTHS})
    for name, denoise in networks.items():
        judged.row(name, lambda y, A, denoise=denoise: denoise(sharp(y, A)))
    for name, denoise in networks.items():
        if name == "RED-CNN":
            continue
        errors: list[float] = []
        judged.row(f"PnP {name}", plug_and_play(denoise, lambda image, to=errors: to.append(judged.rmse(image))))
        best = min(errors[:ITERATIONS])
        share = errors[ITERATIONS - 1] / best
        print(f"    PnP {name}: {ITERATIONS} iterations {share:.3f} of the best, {1 + errors.index(best)}", flush=True)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--cases", default="abdomen,chest,head,pelvis,catsim-chest")
    options.add_argument("--doses", default="40,70,100")
    options.add_argument("--n2n", default="n2n", help="two-stage network; empty for none")
    options.add_argument("--supervised", default="supervised")
    options.add_argument("--red-cnn", default="")
    options.add_argument("--no-classical", action="store_true", help="networks alone")
    given = options.parse_args()
    files = {"RED-CNN": given.red_cnn, "supervised": given.supervised, "two-stage": given.n2n}
    networks = {name: as_denoiser(load_network(network_file(file))) for name, file in files.items() if file}
    print(
        "| case | mA | method | soft tissue | body | bias | lesion kept | s | |\n|---|---|---|---|---|---|---|---|---|"
    )
    for case in cases(given.folder, given.cases.split(",")):
        for dose in map(float, given.doses.split(",")):
            judge(case, dose, given.folder, networks, classical=not given.no_classical)


if __name__ == "__main__":
    main()
