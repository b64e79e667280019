"""What the first use costs: compiling the kernels into an empty cache, against loading them from it.

python benchmarks/first_use.py
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time

PROJECT = """
import time, torch
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.reconstruction import fbp
geometry = FanBeam(evenly_spaced_views(984), 900, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=1.0239)
A = Projector(ImageGrid(512, 512, spacing=0.977), geometry)
x = torch.rand({slices}, 512, 512)
began = time.perf_counter()
y = A(x); A.T(y); fbp(y, A)
print(time.perf_counter() - began)
"""


def run(slices: int, cache: str) -> float:
    """Return the seconds of the first forward, adjoint and FBP of a new process."""
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    code = PROJECT.format(slices=slices)
    return float(subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True).stdout)


def main() -> None:
    print("| slices | empty cache, s | full cache, s |\n|---|---|---|")
    for slices in (1, 2, 4):
        with tempfile.TemporaryDirectory() as cache:
            first = run(slices, cache)
            later = [run(slices, cache) for _ in range(3)]
            print(f"| {slices} | {first:.1f} | {statistics.median(later):.1f} |", flush=True)
    times = []
    for _ in range(5):
        began = time.perf_counter()
        subprocess.run(
            [sys.executable, "-c", "from pnpct.cli import main; main()", "--help"], capture_output=True, check=True
        )
        times.append(time.perf_counter() - began)
    print(f"\npnpct --help: median {statistics.median(times):.2f} s of 5")


if __name__ == "__main__":
    main()
