import pytest
import torch
from low_dose_slice import low_dose_slice

from pnpct.denoisers import TotalVariation
from pnpct.evaluation import coverage, parametric_bootstrap, split_view_difference, spread
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction import fbp, reconstruct

SLICE = low_dose_slice()


def smooth(sinogram: Sinogram, projector: Projector) -> torch.Tensor:
    return fbp(sinogram.line_integrals, projector, kernel="soft")


def test_the_spread_is_that_of_torch() -> None:
    images = 1 + 1e-3 * torch.randn(7, 5, 6, generator=torch.Generator().manual_seed(1))
    found = spread(iter(images))
    torch.testing.assert_close(found.mean, images.mean(dim=0))
    torch.testing.assert_close(found.sd, images.std(dim=0), rtol=1e-3, atol=0)
    assert found.realisations == 7


def test_the_bootstrap_of_a_linear_reconstruction_has_the_spread_of_repeated_scans() -> None:
    data = SLICE.sinogram()
    bootstrapped = spread(
        draw.image
        for draw in parametric_bootstrap(
            lambda sinogram: smooth(sinogram, SLICE.projector),
            smooth(data, SLICE.projector),
            data,
            SLICE.projector,
            realisations=30,
            generator=torch.Generator().manual_seed(1),
        )
    )
    scans = spread(smooth(SLICE.sinogram(seed=seed), SLICE.projector) for seed in range(30))
    ratio = bootstrapped.sd[SLICE.inside].square().mean() / scans.sd[SLICE.inside].square().mean()
    assert float(ratio) == pytest.approx(1.0, abs=0.1)


def test_the_difference_of_the_halves_has_the_noise_of_the_whole_and_no_object() -> None:
    differences = torch.stack(
        [split_view_difference(smooth, SLICE.sinogram(seed=seed), SLICE.projector) for seed in range(12)]
    )
    noise = spread(smooth(SLICE.sinogram(seed=seed), SLICE.projector) for seed in range(100, 130)).sd
    inside = SLICE.inside
    assert 1000 * float(differences.mean(dim=0)[inside].mean().abs()) < 1.0
    varying = differences.std(dim=0)[inside].square().mean() / noise[inside].square().mean()
    assert float(varying) == pytest.approx(1.0, abs=0.15)


def test_coverage_counts_what_is_within_its_bounds() -> None:
    truth, sd = torch.ones(10, 10), torch.full((10, 10), 0.01)
    errors = torch.linspace(-0.04, 0.04, 100).reshape(10, 10)
    found = coverage(truth + errors, truth, sd)
    assert found.pixels == 100
    assert found.share == pytest.approx(float((errors.abs() <= 0.0196).float().mean()))
    assert found.too_low
    upper = torch.arange(10)[:, None].expand(10, 10) < 5
    assert coverage(truth + errors, truth, sd, mask=upper).share < found.share + 0.01
    exact = coverage(truth, truth, sd, mask=upper)
    assert (exact.share, exact.pixels, exact.too_low) == (1.0, 50, False)


def test_bias_takes_the_truth_out_of_the_bounds() -> None:
    truth, sd = torch.zeros(100, 100), torch.full((100, 100), 0.01)
    noise = 0.01 * torch.randn(100, 100, generator=torch.Generator().manual_seed(2))
    assert coverage(noise, truth, sd).share == pytest.approx(0.95, abs=0.01)
    assert coverage(noise + 0.02, truth, sd).too_low


@pytest.mark.slow
def test_bootstrapped_standard_deviations_cover_the_truth() -> None:
    """E18: reported, and below 0.8 too low to be shown alone."""
    data, generator = SLICE.sinogram(), torch.Generator().manual_seed(3)

    def covered(of: object) -> float:
        assert callable(of)
        image = of(data)
        draws = parametric_bootstrap(of, image, data, SLICE.projector, realisations=20, generator=generator)
        found = coverage(image, SLICE.truth, spread(draw.image for draw in draws).sd, mask=SLICE.inside)
        print(found)
        assert not found.too_low
        return found.share

    def tv(sinogram: Sinogram) -> torch.Tensor:
        return reconstruct(sinogram, SLICE.projector, TotalVariation(0.04), iterations=15, stop="never")

    linear = covered(lambda sinogram: fbp(sinogram.line_integrals, SLICE.projector))
    assert 0.85 < linear < 0.97  # 20 draws know a standard deviation to 16 %; edges are biased
    assert 0.8 < covered(tv) < 0.99


def test_what_has_no_spread_is_refused() -> None:
    with pytest.raises(ValueError, match="two images or more, got 1"):
        spread([torch.ones(2, 2)])
    with pytest.raises(ValueError, match="one shape"):
        spread([torch.ones(2, 2), torch.ones(2, 3)])
    with pytest.raises(ValueError, match="mask is empty"):
        coverage(torch.ones(2, 2), torch.ones(2, 2), torch.ones(2, 2), mask=torch.zeros(2, 2, dtype=torch.bool))
