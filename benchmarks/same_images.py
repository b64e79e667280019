"""Whether two versions of pnpct make the same images.

    python benchmarks/same_images.py FOLDER                 (in each version, a folder each)
    python benchmarks/same_images.py FOLDER --against OTHER

The first call simulates small scans of three bodies and reconstructs and denoises them through the command line in
every way there is. The second prints, image by image, the largest and the root mean square difference in HU, and
exits with 1 if one differs by more than 0.05 HU root mean square.
"""

import argparse
import sys
from pathlib import Path

from pnpct.cli import main as pnpct
from pnpct.files import read_image
from pnpct.units import to_hu

SCANS = {
    "abdomen": "--anatomy abdomen --tube-current-ma 40",
    "chest": "--anatomy chest --tube-current-ma 10",
    "head": "--anatomy head --tube-current-ma 100",
}
SMALL = "--size 128 --views 240 --bins 225 --seed 5"
LOOP = "--method pnp --iterations 4"
RECONSTRUCTED = {
    **{f"fbp-{kernel}": f"--method fbp --kernel {kernel}" for kernel in ("ram-lak", "shepp-logan", "hann", "soft")},
    "tv": "--method tv",
    "tv-other": "--method tv --strength 2 --iterations 6 --stop paper",
    **{
        f"pnp-{name}": f"{LOOP} --denoiser {name}" for name in ("tv", "nonlocal-means", "gaussian", "n2n", "supervised")
    },
    "pnp-all-iterations": "--method pnp --denoiser n2n",
    "pnp-sigma-v": f"{LOOP} --denoiser tv --strength 40 --sigma-v 50 --solver cg --inner-iterations 4",
    "pnp-cholesky": f"{LOOP} --denoiser tv --solver cholesky --stop never",
    "pnp-blend": f"{LOOP} --denoiser tv --solver fbp-blend",
}
DENOISED = {name: f"--denoiser {name}" for name in ("tv", "nonlocal-means", "gaussian", "n2n", "supervised")}
MOST_HU = 0.05


def make(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for body, options in SCANS.items():
        scan = folder / f"{body}.scan.h5"
        call("simulate", "scan", scan, *options.split(), *SMALL.split())
        for name, how in RECONSTRUCTED.items():
            call("reconstruct", scan, folder / f"{body}-{name}.h5", *how.split())
        for name, how in DENOISED.items():
            call("denoise", folder / f"{body}-fbp-ram-lak.h5", folder / f"{body}-denoised-{name}.h5", *how.split())


def call(*words: object) -> None:
    if pnpct([str(word) for word in words]):
        sys.exit(f"this version does not know: pnpct {' '.join(map(str, words))}")


def compare(folder: Path, other: Path) -> bool:
    same = True
    print("| image | largest, HU | root mean square, HU |\n|---|---|---|")
    for path in sorted(folder.glob("*.h5")):
        if path.name.endswith(".scan.h5"):
            continue
        (one, _), (two, _) = read_image(path), read_image(other / path.name)
        difference = (to_hu(one) - to_hu(two)).double()
        rms = float(difference.square().mean().sqrt())
        print(f"| {path.stem} | {float(difference.abs().max()):.4f} | {rms:.5f} |")
        same = same and rms <= MOST_HU
    return same


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--against", type=Path)
    given = options.parse_args()
    if given.against is None:
        make(given.folder)
    elif not compare(given.folder, given.against):
        sys.exit(1)


if __name__ == "__main__":
    main()
