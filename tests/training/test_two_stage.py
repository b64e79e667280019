from dataclasses import replace
from itertools import pairwise

import pytest
import torch

from pnpct.denoisers import RDNCBAM, RDNSize
from pnpct.training import Epoch, Pair, mean_squared_error, on_pairs, train, two_stage

TINY = RDNSize(features=4, growth=4, blocks=1, convolutions=2)


def network() -> RDNCBAM:
    torch.manual_seed(1)
    return RDNCBAM(TINY)


class Noise:
    """A ramp with noise; the target has other noise, or little."""

    def __init__(self, target: float) -> None:
        self.target = target

    def __call__(self, number: int) -> Pair:
        generator = torch.Generator().manual_seed(number)
        ramp = 1 + torch.linspace(-0.1, 0.1, 16).expand(16, 16)
        noisy, other = (ramp + s * torch.randn(16, 16, generator=generator) for s in (0.1, self.target))
        return Pair(noisy, other)


OPTIONS = {"pairs_per_epoch": 8, "batch": 4, "learning_rate": 3e-3}


def same(one: Epoch, other: Epoch) -> None:
    assert (one.stage, one.number) == (other.stage, other.number)
    assert one.loss == other.loss
    for kind in ("weights", "latest"):
        for name, value in getattr(one, kind).items():
            assert torch.equal(value, getattr(other, kind)[name]), name


def test_both_stages_lower_their_loss_and_weights_change() -> None:
    D = network()
    options = {**OPTIONS, "learning_rate": 1e-2}
    epochs = list(two_stage(D, Noise(0.1), Noise(0.01), epochs=(6, 6), **options))
    assert [epoch.stage for epoch in epochs] == 6 * ["noise-to-noise"] + 6 * ["fine-tuning"]
    assert epochs[5].loss < epochs[0].loss
    assert epochs[11].loss < epochs[6].loss
    validation = Noise(0.0)(10**6)
    with torch.no_grad():
        denoised = D(validation.input[None])[0]
    assert mean_squared_error(denoised, validation.target) < 0.5 * mean_squared_error(
        validation.input, validation.target
    )


def test_each_stage_makes_its_own_loss_small() -> None:
    def first(output: torch.Tensor, _: torch.Tensor) -> torch.Tensor:
        return output.mean() - output.mean().detach() + 1.0

    def second(output: torch.Tensor, _: torch.Tensor) -> torch.Tensor:
        return output.mean() - output.mean().detach() + 2.0

    epochs = list(two_stage(network(), Noise(0.1), Noise(0.1), epochs=(1, 1), losses=(first, second), **OPTIONS))
    assert [epoch.loss for epoch in epochs] == [1.0, 2.0]


def test_a_noise_conditioned_network_learns_from_the_noise_level() -> None:
    class Levelled(Noise):
        def __call__(self, number: int) -> Pair:
            return replace(super().__call__(number), noise_level=0.1)

    torch.manual_seed(1)
    D = RDNCBAM(TINY, noise_input=True)
    first, *_, last = train(D, on_pairs(Levelled(0.01), mean_squared_error), stage="supervised", epochs=6, **OPTIONS)
    assert last.loss < first.loss
    image = Noise(0.1)(0).input[None]
    with torch.no_grad():
        assert not torch.equal(D(image, 0.1), D(image, 0.01))
    with pytest.raises(ValueError, match="have no noise level"):
        next(train(D, on_pairs(Noise(0.1), mean_squared_error), stage="supervised", epochs=1, **OPTIONS))


def test_a_loss_that_diverges_ends_the_training_with_a_sentence() -> None:
    with pytest.raises(ValueError, match="lower the learning rate"):
        list(
            train(
                network(),
                on_pairs(Noise(0.1), mean_squared_error),
                stage="supervised",
                epochs=3,
                **{**OPTIONS, "learning_rate": 1e30},
            )
        )


@pytest.mark.parametrize("done", [1, 3, 4, 5])
def test_a_resumed_run_equals_an_uninterrupted_one(done: int) -> None:
    whole = list(two_stage(network(), Noise(0.1), Noise(0.01), epochs=(3, 3), **OPTIONS))
    for _ in range(2):  # the record is not used up
        rest = list(two_stage(network(), Noise(0.1), Noise(0.01), epochs=(3, 3), after=whole[done - 1], **OPTIONS))
        assert len(rest) == 6 - done
        for one, other in zip(whole[done:], rest, strict=True):
            same(one, other)


def test_the_learning_rate_rises_to_its_highest_and_falls_to_zero() -> None:
    options = {**OPTIONS, "pairs_per_epoch": 4}  # an epoch is a step
    epochs = train(network(), on_pairs(Noise(0.1), mean_squared_error), stage="supervised", epochs=40, **options)
    rates = [epoch.optimizer["param_groups"][0]["lr"] for epoch in epochs]
    assert rates[0] == pytest.approx(1.5e-3)
    assert rates[1] == pytest.approx(3e-3, rel=0.01)
    assert all(later < earlier for earlier, later in pairwise(rates[1:]))
    assert rates[20] == pytest.approx(1.5e-3)
    assert rates[-1] < 1e-5


def test_the_network_has_the_average_of_the_latest_weights() -> None:
    D = network()
    *_, before, last = train(D, on_pairs(Noise(0.1), mean_squared_error), stage="supervised", epochs=30, **OPTIONS)
    assert all(torch.equal(value, last.weights[name]) for name, value in D.state_dict().items())
    change, change_of_average = (
        sum(float((getattr(last, of)[name] - value).square().sum()) for name, value in getattr(before, of).items())
        for of in ("latest", "weights")
    )
    assert change_of_average > 0
    distance = sum(float((last.latest[name] - value).square().sum()) for name, value in last.weights.items())
    assert distance > change


def test_numbers_that_cannot_be_are_refused() -> None:
    def begin(**changes: object) -> None:
        options = {**OPTIONS, "epochs": 1, **changes}
        next(train(network(), on_pairs(Noise(0.1), mean_squared_error), stage="supervised", **options))

    with pytest.raises(ValueError, match="batches of 3"):
        begin(batch=3)
    with pytest.raises(ValueError, match="4 in a batch and 0 in a micro-batch; each is at least 1"):
        begin(micro_batch=0)
    with pytest.raises(ValueError, match="Both stages need at least one epoch, got 3 and 0"):
        next(two_stage(network(), Noise(0.1), Noise(0.1), epochs=(3, 0), **OPTIONS))
    with pytest.raises(ValueError, match="learning rate"):
        begin(learning_rate=0.0)
    epoch = next(train(network(), on_pairs(Noise(0.1), mean_squared_error), stage="supervised", epochs=1, **OPTIONS))
    with pytest.raises(ValueError, match=r"Epoch 1 of .* cannot be continued by .* fine-tuning"):
        list(two_stage(network(), Noise(0.1), Noise(0.1), epochs=(1, 1), after=epoch, **OPTIONS))
