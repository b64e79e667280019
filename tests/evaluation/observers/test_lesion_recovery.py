import math

import numpy as np
import pytest
import torch
from low_dose_slice import Slice, disc, disc_spectrum, low_dose_slice, pixel_at

from pnpct.denoisers import Gaussian, TotalVariation
from pnpct.evaluation import (
    channelised_hotelling,
    insert_lesion,
    lesion_recovery,
    redraw,
    rmse_hu,
    task_transfer,
)
from pnpct.geometry import ImageGrid, Lesion
from pnpct.operators import Kernel
from pnpct.physics import BandedWeights, Sinogram
from pnpct.reconstruction import fbp, reconstruct

SLICE = low_dose_slice()
LESION = Lesion((32.5, -22.5, 7.0), radius=12.0, contrast_hu=-60.0)
CHANGE = LESION.contrast_hu / 1000 * disc(LESION.center[:2], LESION.radius, SLICE.grid)


def test_a_perfect_image_has_all_of_the_lesion_and_nothing_else() -> None:
    found = lesion_recovery(SLICE.truth + CHANGE, SLICE.truth, LESION, SLICE.grid)
    assert found.recovered == pytest.approx(1.0, abs=1e-5)
    assert found.spill == pytest.approx(0.0, abs=0.01)
    assert found.distant_hu == 0.0


def test_half_of_the_lesion_is_recovered_as_half_and_an_erased_one_as_nothing() -> None:
    assert lesion_recovery(SLICE.truth + CHANGE / 2, SLICE.truth, LESION, SLICE.grid).recovered == pytest.approx(0.5)
    assert lesion_recovery(SLICE.truth, SLICE.truth, LESION, SLICE.grid).recovered == 0.0


def test_a_blur_spills_the_lesion_into_its_ring() -> None:
    blurred = lesion_recovery(Gaussian(strength=1.5)(CHANGE), torch.zeros_like(CHANGE), LESION, SLICE.grid)
    assert blurred.recovered < 0.8
    assert blurred.spill > 0.1


def test_what_changes_far_away_is_seen() -> None:
    row, col = pixel_at(SLICE.grid, (-70.0, 40.0))
    changed = SLICE.truth + CHANGE
    changed[row, col] += 0.1
    found = lesion_recovery(changed, SLICE.truth, LESION, SLICE.grid)
    assert 0.5 < found.distant_hu * 64 / 100 < 1.3  # one pixel of about 64², 100 HU


def test_an_inserted_lesion_is_its_projection_and_costs_quanta() -> None:
    data = SLICE.sinogram()
    inserted = insert_lesion(data, SLICE.projector, LESION)
    added = SLICE.projector(CHANGE)
    torch.testing.assert_close(inserted.line_integrals - data.line_integrals, added, atol=1e-6, rtol=0)
    torch.testing.assert_close(inserted.weights.diagonal, data.weights.diagonal * torch.exp(-added))
    assert float(inserted.weights.diagonal.sum()) > float(
        data.weights.diagonal.sum()
    )  # a dark lesion lets more through


def test_a_twin_scan_and_an_insertion_agree() -> None:
    data, twin = SLICE.sinogram(seed=1), SLICE.sinogram(SLICE.truth + CHANGE, seed=1)

    def smooth(sinogram: Sinogram) -> torch.Tensor:
        return fbp(sinogram.line_integrals, SLICE.projector, kernel="hann")

    inserted, scanned = (
        lesion_recovery(smooth(present), smooth(data), LESION, SLICE.grid)
        for present in (insert_lesion(data, SLICE.projector, LESION), twin)
    )
    assert scanned.recovered == pytest.approx(inserted.recovered, abs=1e-4)
    assert scanned.spill == pytest.approx(inserted.spill, abs=1e-4)
    assert 0.7 < scanned.recovered < 1.1


@pytest.mark.slow
@pytest.mark.parametrize("kernel", ["ram-lak", "hann", "soft"])
def test_fbp_recovers_what_its_transfer_lets_through(kernel: Kernel) -> None:
    """Within 0.05 of the band-limited disc."""
    fine = low_dose_slice(128)
    edge = disc((0.0, 0.0), 30.0, fine.grid)
    transfer = task_transfer(
        fbp(fine.projector(0.1 * edge), fine.projector, kernel=kernel)[None],
        grid=fine.grid,
        center=(0.0, 0.0),
        radius=30.0,
    )
    f = np.linspace(0.0, 0.4, 4001)
    for diameter in (6.0, 8.0, 12.0, 16.0):
        lesion = Lesion((20.0, -10.0, 0.0), diameter / 2, 50.0)
        line_integrals = fine.projector(0.05 * disc(lesion.center[:2], lesion.radius, fine.grid))
        image = fbp(line_integrals, fine.projector, kernel=kernel)
        found = lesion_recovery(image, torch.zeros_like(image), lesion, fine.grid)
        # Mean of the band-limited disc over the core: ∫ disc · transfer · core, all radial.
        core = disc_spectrum(0.6 * diameter, f)
        expected = np.trapezoid(disc_spectrum(diameter, f) * transfer(f) * core * 2 * math.pi * f, f)
        assert found.recovered == pytest.approx(expected / (math.pi * (0.3 * diameter) ** 2), abs=0.05)


KERNELS: tuple[Kernel, ...] = ("ram-lak", "hann", "soft")


def noisy_fbp(fine: Slice, data: Sinogram, *, images: int) -> dict[Kernel, torch.Tensor]:
    clean, generator = fine.projector(fine.truth), torch.Generator().manual_seed(5)
    noisy = torch.stack([redraw(data, clean, generator=generator).line_integrals for _ in range(images)])
    return {kernel: fbp(noisy, fine.projector, kernel=kernel) for kernel in KERNELS}


def best_d_prime(fine: Slice, without: dict[Kernel, torch.Tensor], lesion: Lesion) -> float:
    """The highest d′ of the Hotelling observer over the kernels of FBP, which is linear."""
    line_integrals = fine.projector(lesion.contrast_hu / 1000 * disc(lesion.center[:2], lesion.radius, fine.grid))
    row, col = pixel_at(fine.grid, lesion.center[:2])
    reach = int(2 * lesion.radius / fine.grid.spacing) + 1
    values = []
    for kernel, images in without.items():
        signal = fbp(line_integrals, fine.projector, kernel=kernel)
        patch = np.s_[..., row - reach : row + reach + 1, col - reach : col + reach + 1]
        pairs = len(images) // 2
        found = channelised_hotelling(
            images[:pairs][patch] + signal[patch],
            images[pairs:][patch],
            spacing=fine.grid.spacing,
            diameter=2 * lesion.radius,
            generator=np.random.default_rng(1),
            resamples=20,
        )
        values.append(found.d_prime.estimate)
    return max(values)


@pytest.mark.slow
def test_a_weak_prior_keeps_what_fbp_can_show_and_the_one_of_least_error_does_not() -> None:
    """At least 0.8 of every lesion that FBP would show with a d′ of 3.

    Discs of 12 and 16 mm, for a pixel has 2.5 mm: of 8 mm the core is one pixel, and soft FBP keeps 0.67 itself.
    """
    fine = low_dose_slice(128)
    data = fine.sinogram()
    weak, strong = 0.013, 0.03

    def tv(strength: float, sinogram: Sinogram) -> torch.Tensor:
        return reconstruct(sinogram, fine.projector, TotalVariation(strength), iterations=30, stop="never")

    without = {strength: tv(strength, data) for strength in (weak, strong)}
    errors = {strength: rmse_hu(image, fine.truth, mask=fine.inside) for strength, image in without.items()}
    assert errors[strong] < errors[weak]
    noise = noisy_fbp(fine, data, images=160)
    lost = 0
    for center, radius, contrast in (
        ((1.25, -21.25, 0.0), 6.0, -120.0),
        ((1.25, -21.25, 0.0), 8.0, -60.0),
        ((91.25, 21.25, 0.0), 6.0, -120.0),
        ((91.25, 21.25, 0.0), 8.0, -60.0),
    ):
        lesion = Lesion(center, radius, contrast)
        assert best_d_prime(fine, noise, lesion) >= 3
        present = insert_lesion(data, fine.projector, lesion)
        kept = {
            strength: lesion_recovery(tv(strength, present), image, lesion, fine.grid).recovered
            for strength, image in without.items()
        }
        assert 0.8 <= kept[weak] <= 1.1
        lost += kept[strong] < 0.8
    assert lost >= 2


def test_what_cannot_be_measured_is_refused() -> None:
    data = SLICE.sinogram()
    outside = Lesion((155.0, 0.0, 0.0), radius=12.0, contrast_hu=-60.0)
    with pytest.raises(ValueError, match="wholly on the image"):
        insert_lesion(data, SLICE.projector, outside)
    with pytest.raises(ValueError, match="without contrast"):
        lesion_recovery(SLICE.truth, SLICE.truth, Lesion(LESION.center, 12.0, 0.0), SLICE.grid)
    with pytest.raises(ValueError, match="must have"):
        lesion_recovery(SLICE.truth[1:], SLICE.truth[1:], LESION, SLICE.grid)
    small = torch.ones(8, 8)
    with pytest.raises(ValueError, match="farther than 20 mm"):
        lesion_recovery(small, small, Lesion((0.0, 0.0, 0.0), 15.0, 10.0), ImageGrid(8, 8, spacing=5.0))
    banded = Sinogram(data.line_integrals, BandedWeights((1 / data.weights.diagonal)[:, None, :]))
    with pytest.raises(ValueError, match="independent noise only"):
        insert_lesion(banded, SLICE.projector, LESION)
