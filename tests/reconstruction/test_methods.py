"""Methods are frozen values: their fields are the options, and what they say of themselves is what they did."""

import itertools

import pytest
import torch

from pnpct.denoisers import RDNCBAM, LearnedDenoiser, RDNSize, TotalVariation
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import (
    DAMPING,
    FBP,
    TVPWLS,
    ADMMState,
    DenoisedFBP,
    PlugAndPlay,
    denoiser_settings,
    fbp,
    pnp_admm,
    reconstruct,
    sigma_v_from_beta,
    starting_state,
)

TV = TotalVariation(0.05)


@pytest.fixture(scope="module")
def A(grid: ImageGrid, geometry: FanBeam) -> Projector:
    return Projector(grid, geometry)


@pytest.fixture(scope="module")
def sinogram(A: Projector, disk: torch.Tensor) -> Sinogram:
    generator = torch.Generator().manual_seed(3)
    y = A(disk)
    return Sinogram(y + 0.02 * torch.randn(y.shape, generator=generator), DiagonalWeights(torch.exp(-y)))


@pytest.fixture(scope="module")
def network() -> LearnedDenoiser:
    torch.manual_seed(0)
    network = RDNCBAM(RDNSize(features=4, growth=2, blocks=1, convolutions=2, unshuffle=2))
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    return LearnedDenoiser(network, name="tiny")


def iterates(sinogram: Sinogram, A: Projector, denoise, number: int, damping: float) -> list[torch.Tensor]:
    states = pnp_admm(sinogram, A, denoise, starting_state(sinogram, A), damping=damping)
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


def test_around_a_classical_denoiser_the_image_is_the_last_iterate_undamped(sinogram, A):
    made = PlugAndPlay(TV, iterations=4)(sinogram, A)
    assert torch.equal(made.image, iterates(sinogram, A, TV, 4, damping=0.0)[-1])
    assert (made.settings["damping"], made.settings["result"]) == (0.0, "last")
    assert (made.iterations, made.stopped_by) == (4, "iterations")


def test_around_a_network_it_is_the_mean_of_the_damped_iterates(sinogram, A, network):
    made = PlugAndPlay(network, iterations=4)(sinogram, A)
    mean = torch.stack(iterates(sinogram, A, network, 4, damping=DAMPING)).mean(0)
    torch.testing.assert_close(made.image, mean, rtol=0, atol=1e-6)
    assert (made.settings["damping"], made.settings["result"]) == (DAMPING, "mean")
    assert made.settings["denoiser"] == "tiny"


def test_what_suits_a_denoiser_gives_way_to_what_is_said(sinogram, A, network):
    made = PlugAndPlay(network, iterations=3, damping=0.0, result="last")(sinogram, A)
    assert torch.equal(made.image, iterates(sinogram, A, network, 3, damping=0.0)[-1])


def test_reconstruct_is_the_one_line_around_the_method(sinogram, A):
    assert torch.equal(reconstruct(sinogram, A, TV, iterations=2), PlugAndPlay(TV, iterations=2)(sinogram, A).image)


def test_the_mean_does_not_wander_around_a_denoiser_that_does(sinogram, A):
    """A denoiser that adds ±c in turn makes iterates that never settle; their mean does."""

    def change(result: str) -> float:
        images = []
        for number in (19, 20):
            sign = itertools.cycle((1.0, -1.0))
            restless = lambda image: TV(image) + 0.02 * next(sign)  # noqa: B023, E731
            images.append(PlugAndPlay(restless, iterations=number, result=result, stop="never")(sinogram, A).image)
        return float((images[1] - images[0]).square().mean().sqrt())

    assert change("last") > 10 * change("mean")


def test_sigma_v_and_beta_are_recorded_as_what_they_were(sinogram, A):
    sigma_v = sigma_v_from_beta(0.7, sinogram, A)
    images = [PlugAndPlay(TV, iterations=2, **one)(sinogram, A) for one in ({"beta": 0.7}, {"sigma_v": sigma_v})]
    torch.testing.assert_close(images[0].image, images[1].image, rtol=0, atol=1e-5)
    for made in images:
        assert made.settings["beta"] == pytest.approx(0.7)
        assert made.settings["sigma_v_hu"] == pytest.approx(sigma_v)


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
    assert seen[-1].v is made.image


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
        (lambda: PlugAndPlay(TV, beta=1.0, sigma_v=50.0), "give one of them"),
        (lambda: PlugAndPlay(TV, solver="fbp-blend", inner_iterations=2), "takes no inner iterations"),
        (lambda: TVPWLS(strength=-1.0), "from 0 up, got -1"),
        (lambda: TVPWLS(beta=0.0), "beta must be a positive number"),
    ],
)
def test_options_out_of_range_are_refused_where_the_method_is_made(make, words):
    with pytest.raises(ValueError, match=words):
        make()
