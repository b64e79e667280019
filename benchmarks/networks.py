"""How long a network takes for one slice of 512 x 512 pixels, against RED-CNN.

    python benchmarks/networks.py [--rounds 7]

Prints the cost of every size, then for the small one, in single precision and in bfloat16, and for RED-CNN the median
of interleaved rounds, the ratio to RED-CNN in the same rounds, and how far bfloat16 moves the image of the network that
comes with the package, HU RMS. Threads are PyTorch's own choice.
"""

import argparse
import statistics
import time

import torch

from pnpct.denoisers import RDNCBAM, REDCNN, SIZES, Denoise, LearnedDenoiser
from pnpct.denoisers.network_cost import network_cost
from pnpct.files import load_network, network_file
from pnpct.units import to_hu

SIDE = 512


def slice_like_fbp(noise_hu: float) -> torch.Tensor:
    """A body of water with an organ, and noise whose power rises with the frequency."""
    distance = torch.hypot(*torch.meshgrid(*2 * [torch.arange(SIDE) - SIDE / 2], indexing="ij"))
    frequency = torch.hypot(*torch.meshgrid(*2 * [torch.fft.fftfreq(SIDE)], indexing="ij"))
    white = torch.randn(SIDE, SIDE, generator=torch.Generator().manual_seed(1))
    noise = torch.fft.ifft2(torch.fft.fft2(white) * frequency).real
    return (distance < 200).float() + 0.06 * (distance < 60) + noise_hu / 1000 * noise / noise.std()


def seconds(denoise: Denoise, image: torch.Tensor) -> float:
    began = time.perf_counter()
    denoise(image)
    return time.perf_counter() - began


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=7)
    rounds = options.parse_args().rounds
    networks = {**{name: RDNCBAM(size) for name, size in SIZES.items()}, "RED-CNN": REDCNN()}
    print("| network | parameters | multiply-adds for a slice |\n|---|---|---|")
    for name, network in networks.items():
        cost = network_cost(network, SIDE, SIDE)
        print(f"| {name} | {cost.parameters:,} | {cost.multiply_adds / 1e9:.0f} · 10⁹ |")
    shipped = load_network(network_file("n2n"))
    raced = {
        "small": LearnedDenoiser(shipped),
        "small, bfloat16": LearnedDenoiser(shipped, bfloat16=True),
        "RED-CNN": LearnedDenoiser(networks["RED-CNN"]),
    }
    image = slice_like_fbp(60.0)
    times: dict[str, list[float]] = {name: [] for name in raced}
    for number in range(rounds + 1):
        for name, denoise in raced.items():
            taken = seconds(denoise, image)
            if number:  # the first round warms up
                times[name].append(taken)
    print(f"\n| {torch.get_num_threads()} threads | s, median | of RED-CNN |\n|---|---|---|")
    for name, taken in times.items():
        ratios = [each / other for each, other in zip(taken, times["RED-CNN"], strict=True)]
        print(f"| {name} | {statistics.median(taken):.2f} | {statistics.median(ratios):.3f} |")
    for noise_hu in (10.0, 50.0, 200.0):
        image = slice_like_fbp(noise_hu)
        moved = to_hu(raced["small, bfloat16"](image)) - to_hu(raced["small"](image))
        print(f"bfloat16 moves {moved.square().mean().sqrt():.2f} HU RMS at {noise_hu:g} HU of noise")


if __name__ == "__main__":
    main()
