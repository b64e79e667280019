"""Methods are frozen values: their fields are the options, and what they say of themselves is what they did."""

import itertools

import pytest
import torch

from pnpct.denoisers import RDNCBAM, AcrossSlices, Gaussian, LearnedDenoiser, RDNSize, TotalVariation, denoiser_settings
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import (
    FBP,
    TVPWLS,
    ADMMState,
    DenoisedFBP,
    PlugAndPlay,
    fbp,
    pnp_admm,
    reconstruct,
    starting_state,
)
from pnpct.reconstruction.around_network import around_network
from pnpct.reconstruction.iteration_schedule import FALL, FEWEST, MOST, enough_iterations, falling
from pnpct.reconstruction.normal_equations import balanced_sigma_v, plain

TV = TotalVariation(0.05)


@pytest.fixture(scope="module")
def A(grid: ImageGrid, geometry: FanBeam) -> Projector:
    return Projector(grid, geometry)


@pytest.fixture(scope="module")
def sinogram(A: Projector, disk: torch.Tensor) -> Sinogram:
    generator = torch.Generator().manual_seed(3)
    y = A(disk)
    return Sinogram(y + 0.005 * torch.randn(y.shape, generator=generator), DiagonalWeights(torch.exp(-y) / 0.005**2))


@pytest.fixture(scope="module")
def network() -> LearnedDenoiser:
    torch.manual_seed(0)
    network = RDNCBAM(RDNSize(features=4, growth=2, blocks=1, convolutions=2, unshuffle=2))
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    return LearnedDenoiser(network, name="tiny")


def iterates(sinogram: Sinogram, A: Projector, denoise, number: int) -> list[torch.Tensor]:
    start, last = starting_state(sinogram, A), PlugAndPlay.sigma_v
    sigma_v = falling(balanced_sigma_v(sinogram, A, start.v), last)
    denoise = around_network(denoise, A.grid.spacing)
    states = pnp_admm(sinogram, A, denoise, start, sigma_v=sigma_v, damping=PlugAndPlay.damping)
    return [state.v for state in itertools.islice(states, number)]


def test_fbp_is_the_function_with_the_kernel_of_the_field(sinogram, A):
    made = FBP("soft")(sinogram, A)
    assert torch.equal(made.image, fbp(sinogram.line_integrals, A, kernel="soft"))
    assert made.settings == {"method": "fbp", "kernel": "soft"}
    assert (made.iterations, made.stopped_by) == (0, "")


def test_a_denoiser_alone_works_on_sharp_fbp(sinogram, A):
    made = DenoisedFBP(TV)(sinogram, A)
    assert torch.equal(made.image, TV(fbp(sinogram.line_integrals, A, kernel="ram-lak")))
    assert made.settings["kernel"] == "ram-lak"


def test_the_image_is_the_last_denoised_iterate(sinogram, A):
    made = PlugAndPlay(TV, iterations=4)(sinogram, A)
    assert torch.equal(made.image, iterates(sinogram, A, TV, 4)[-1])
    assert (made.iterations, made.stopped_by) == (4, "iterations")


def test_around_a_network_it_is_the_mean_of_the_last_two(sinogram, A, network):
    made = PlugAndPlay(network, iterations=4)(sinogram, A)
    *_, third, fourth = iterates(sinogram, A, network, 4)
    torch.testing.assert_close(made.image, (third + fourth) / 2)
    assert (fourth - third).abs().max() > 1e-4
    once = PlugAndPlay(AcrossSlices(network), iterations=1)(sinogram, A)
    assert torch.equal(once.image, iterates(sinogram, A, network, 1)[0])
    assert made.settings["denoiser"] == "tiny"
    assert made.settings["sigma_v_hu"] == PlugAndPlay.sigma_v


def test_at_low_dose_sigma_v_falls_to_what_was_asked_for(sinogram, A, monkeypatch):
    """From the balance of data and prior, if that is more than three times the last one; the fixed point is that of
    the end, since the dual variable β u stays."""
    weak = Sinogram(sinogram.line_integrals, DiagonalWeights(sinogram.weights.diagonal / 100))
    start, damping = starting_state(weak, A), PlugAndPlay.damping
    begun, solver = float(balanced_sigma_v(weak, A, start.v)), []
    last = 0.2 * begun

    def recorded(_sinogram, _A):
        solve = plain(_sinogram, _A)
        return lambda b, beta, x: solver.append(1000 / float(beta) ** 0.5) or solve(b, beta, x)

    monkeypatch.setattr("pnpct.reconstruction.methods.solver_by_name", lambda *_, **__: recorded)
    blur = Gaussian(0.7)
    made = PlugAndPlay(blur, sigma_v=last, iterations=20, stop="never")(weak, A).image
    assert solver == pytest.approx([begun, FALL * begun, FALL**2 * begun, *17 * [last]], rel=1e-5)
    from_there = itertools.islice(pnp_admm(weak, A, blur, start, sigma_v=last, damping=damping), 39, None)
    assert float((made - next(from_there).v).square().mean().sqrt()) < 1e-3


def test_the_noisier_an_image_the_more_iterations_are_enough():
    numbers = enough_iterations(torch.tensor([0.1, 1.9, 2.1, 3.0, 4.0, 9.0])).tolist()
    assert numbers == [FEWEST, FEWEST, 4, 6, 9, MOST]


def test_each_image_of_a_batch_has_its_own_number_of_iterations(sinogram, A):
    y, w, blur = sinogram.line_integrals, sinogram.weights.diagonal, Gaussian(0.7)
    balanced = float(balanced_sigma_v(sinogram, A))
    weights = [w * (balanced / (ratio * PlugAndPlay.sigma_v)) ** 2 for ratio in (1.0, 3.0, 9.0)]
    numbers = [PlugAndPlay(blur)(Sinogram(y, DiagonalWeights(each)), A).iterations for each in weights]
    assert numbers == [FEWEST, 6, MOST]
    batch = Sinogram(y.expand(3, *y.shape), DiagonalWeights(torch.stack(weights)))
    together = PlugAndPlay(blur)(batch, A)
    assert (together.iterations, together.stopped_by) == (MOST, "iterations")
    as_many = {number: PlugAndPlay(blur, iterations=number)(batch, A).image for number in numbers}
    assert torch.equal(together.image, torch.stack([as_many[number][i] for i, number in enumerate(numbers)]))
    assert (as_many[MOST] - together.image).abs().amax((-2, -1)).gt(1e-3).tolist() == [True, True, False]


def test_reconstruct_is_the_one_line_around_the_method(sinogram, A):
    assert torch.equal(reconstruct(sinogram, A, TV, iterations=2), PlugAndPlay(TV, iterations=2)(sinogram, A).image)


def test_a_rule_that_ends_the_iterations_is_named(sinogram, A):
    made = TVPWLS(iterations=50, stop="paper")(sinogram, A)
    assert made.iterations < 50
    assert made.stopped_by == "paper"


def test_progress_sees_every_iterate_and_the_most_there_can_be(sinogram, A):
    seen: list[ADMMState] = []

    def watched(states, most):
        assert most == 3
        for state in states:
            seen.append(state)
            yield state

    made = TVPWLS(iterations=3)(sinogram, A, progress=watched)
    assert len(seen) == made.iterations == 3
    assert torch.equal(seen[-1].v, made.image)


def test_settings_are_known_before_the_work_and_hold_afterwards(sinogram, A, network):
    for method in (FBP(), DenoisedFBP(TV), TVPWLS(iterations=1), PlugAndPlay(network, iterations=1)):
        assert dict(method.settings).items() <= dict(method(sinogram, A).settings).items()


def test_denoisers_say_what_they_are():
    def own(image: torch.Tensor) -> torch.Tensor:
        return image

    assert denoiser_settings(TotalVariation(0.03))["denoiser_strength"] == 0.03
    assert denoiser_settings(own)["denoiser"].endswith("own")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PlugAndPlay(TV, sigma_v=-1.0), "sigma_v is a positive number of HU, got -1"),
        (lambda: PlugAndPlay(TV, damping=1.5), "damping is a fraction"),
        (lambda: PlugAndPlay(TV, solver="fbp-blend", inner_iterations=2), "takes no inner iterations"),
        (lambda: TVPWLS(strength=-1.0), "from 0 up, got -1"),
    ],
)
def test_options_out_of_range_are_refused_where_the_method_is_made(make, words):
    with pytest.raises(ValueError, match=words):
        make()
