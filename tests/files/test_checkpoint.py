import json
import shutil
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save

from pnpct.denoisers import DENOISERS, RDNCBAM, REDCNN, LearnedDenoiser, RDNSize
from pnpct.files import (
    FileFormatError,
    load_denoiser,
    load_network,
    network_file,
    network_names,
    save_network,
    sha256_of,
)
from pnpct.files.checkpoint import ABOUT

TINY = RDNSize(features=4, growth=2, blocks=1, convolutions=2, unshuffle=2)
SAID = {
    "command": ["pnpct", "train"],
    "licence": "Apache-2.0",
    "manifest_sha256": "0" * 64,
    "metrics": {"psnr": 38.5, "curve": (1, 2)},
    "seed": 7,
}
NETWORKS = {
    "rdn-cbam": RDNCBAM(TINY),
    "told": RDNCBAM(TINY, noise_input=True),
    "global": RDNCBAM(TINY, attention="global"),
    "red-cnn": REDCNN(filters=2),
}


@pytest.fixture(scope="module", params=NETWORKS)
def network(request) -> torch.nn.Module:
    generator = torch.Generator().manual_seed(1)
    network = NETWORKS[request.param]
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.2, generator=generator)
    return network


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "net.safetensors"
    save_network(path, RDNCBAM(TINY), about=SAID)
    return path


def sidecar_of(path: Path) -> Path:
    return path.with_name(path.name + ".json")


def test_what_is_written_is_read(network, tmp_path, generator):
    path = tmp_path / "net.safetensors"
    save_network(path, network, about=SAID)
    assert {file.name for file in tmp_path.iterdir()} == {"net.safetensors", "net.safetensors.json"}
    found = load_network(path)
    assert type(found) is type(network)
    needed = network.state_dict()
    assert found.state_dict().keys() == needed.keys()
    assert all(torch.equal(tensor, needed[name]) for name, tensor in found.state_dict().items())
    assert all(parameter.requires_grad for parameter in found.parameters())
    level = 30.0 if getattr(network, "noise_input", False) else None
    image = 1 + 0.1 * torch.randn(24, 25, generator=generator)
    torch.testing.assert_close(
        load_denoiser(path, noise_level_hu=level)(image),
        LearnedDenoiser(network, noise_level=level and level / 1000)(image),
    )


def test_the_sidecar_says_what_the_network_is(path):
    said = json.loads(sidecar_of(path).read_text())
    assert said["architecture"] == "rdn-cbam"
    assert RDNSize(**said["size"]) == TINY
    assert (said["noise_input"], said["attention"], said["normalisation"]) == (False, "local", "HU/1000")
    assert said["sha256"] == sha256_of(path)
    assert said["about"] == {**SAID, "metrics": {"psnr": 38.5, "curve": [1, 2]}}


def test_the_same_network_and_words_make_the_same_bytes(path, tmp_path):
    again = tmp_path / "again.safetensors"
    network = load_network(path).to(memory_format=torch.channels_last)
    save_network(again, network, about=dict(reversed(SAID.items())))
    assert again.read_bytes() == path.read_bytes()
    assert sidecar_of(again).read_bytes() == sidecar_of(path).read_bytes()


def test_reading_draws_no_random_numbers(path):
    state = torch.get_rng_state()
    load_network(path)
    assert torch.equal(torch.get_rng_state(), state)


def test_what_is_read_can_be_trained_on(path):
    network = load_network(path)
    network(torch.full((1, 8, 8), 1.1)).sum().backward()
    assert network.noise.weight.grad is not None


@pytest.mark.parametrize("blocked", ["net.safetensors", "net.safetensors.json"])
def test_if_one_file_cannot_be_written_neither_is(tmp_path, blocked):
    (tmp_path / blocked).mkdir()
    with pytest.raises(IsADirectoryError):
        save_network(tmp_path / "net.safetensors", RDNCBAM(TINY), about=SAID)
    assert [file.name for file in tmp_path.iterdir()] == [blocked]


def infinite() -> RDNCBAM:
    network = RDNCBAM(TINY)
    network.noise.bias.data[0] = torch.inf
    return network


@pytest.mark.parametrize(
    ("name", "network", "about", "message"),
    [
        ("net.pt", RDNCBAM(TINY), SAID, "end in .safetensors, got net.pt"),
        ("net.safetensors", torch.nn.Linear(1, 1), SAID, "RDNCBAM or a REDCNN .* Linear"),
        ("net.safetensors", infinite(), SAID, "noise.bias are not finite"),
        ("net.safetensors", RDNCBAM(TINY), {}, f"{', '.join(ABOUT)}; command and 4 more"),
        ("net.safetensors", RDNCBAM(TINY), SAID | {"metrics": {"psnr": float("nan")}}, "plain, finite"),
        ("net.safetensors", RDNCBAM(TINY), SAID | {"metrics": torch.ones(1)}, "plain, finite"),
        ("net.safetensors", RDNCBAM(TINY), SAID | {"manifest_sha256": "abc"}, "hexadecimal or None, got 'abc'"),
    ],
)
def test_what_cannot_be_read_again_is_not_written(tmp_path, name, network, about, message):
    with pytest.raises(ValueError, match=message):
        save_network(tmp_path / name, network, about=about)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "does not describe a network of pnpct"),
        ({"format_version": 2}, "version 2, but 1 is known; update pnpct"),
        ({"format_version": None}, "version None"),
        ({"normalisation": "0 to 1"}, 'normalisation "0 to 1", but "HU/1000" is needed'),
        ({"units": "HU"}, 'units "HU"'),
        ({"architecture": "unet"}, '"unet"; rdn-cbam and red-cnn are known'),
        ({"architecture": ["rdn-cbam"]}, "rdn-cbam and red-cnn are known"),
        ({"architecture": "red-cnn"}, "does not describe a complete red-cnn network"),
        ({"size": {"filters": 2}}, "does not describe a complete rdn-cbam network"),
        ({"size": {**vars(TINY), "blocks": 0}}, "at least one of everything"),
        ({"size": {**vars(TINY), "growth": 2.5}}, "growth.*2.5"),
        ({"size": {**vars(TINY), "features": 10**30}}, "does not describe a complete rdn-cbam network"),
        ({"size": None}, "its size is None"),
        ({"attention": "nonlocal"}, "attention nonlocal"),
        ({"noise_input": 1}, "noise_input is 1"),
        ({"sha256": "0" * 64}, "is not the file that net.safetensors.json describes"),
        ({"size": {**vars(TINY), "blocks": 2}}, r"lacks blocks\.1\.\S+ and 11 more"),
        ({"size": {**vars(TINY), "convolutions": 1}}, r"holds blocks\.0\.layers\.1\.bias and 1 more"),
        ({"noise_input": True}, r"shallow\.weight must be \[4, 8, 3, 3\] torch.float32 .* got \[4, 4, 3, 3\]"),
    ],
)
def test_a_description_that_does_not_match_is_refused_in_one_sentence(path, changes, message):
    content = json.loads(sidecar_of(path).read_text())
    sidecar_of(path).write_text(json.dumps(content | changes))
    with pytest.raises(FileFormatError, match=message) as raised:
        load_network(path)
    assert str(raised.value).startswith(str(path))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("text", ["{", "[]", "", "\xff"])
def test_a_broken_sidecar_is_refused(path, text):
    sidecar_of(path).write_text(text, encoding="latin-1")
    with pytest.raises(FileFormatError, match=r"safetensors.json(: this is not JSON|: a JSON| does not describe)"):
        load_network(path)


def test_numbers_that_have_changed_are_refused(path):
    numbers = bytearray(path.read_bytes())
    numbers[-1] ^= 1
    path.write_bytes(numbers)
    with pytest.raises(FileFormatError, match="is not the file"):
        load_network(path)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        (b"", "not a complete .safetensors file"),
        (b"\x80\x02cos\nsystem\n", "not a complete .safetensors file"),
        (save({"a": torch.ones(1)}), "lacks"),
    ],
)
def test_other_numbers_with_the_right_fingerprint_are_refused(path, numbers, message):
    path.write_bytes(numbers)
    content = json.loads(sidecar_of(path).read_text())
    sidecar_of(path).write_text(json.dumps(content | {"sha256": sha256_of(path)}))
    with pytest.raises(FileFormatError, match=message):
        load_network(path)


def test_half_precision_is_refused(path):
    path.write_bytes(save({name: tensor.half() for name, tensor in load_file(path).items()}))
    content = json.loads(sidecar_of(path).read_text())
    sidecar_of(path).write_text(json.dumps(content | {"sha256": sha256_of(path)}))
    with pytest.raises(FileFormatError, match=r"must be .* torch\.float32 .* torch\.float16"):
        load_network(path)


def test_numbers_alone_are_refused(path):
    sidecar_of(path).unlink()
    with pytest.raises(FileFormatError, match=r"comes without net\.safetensors\.json.*copy both files"):
        load_network(path)


def test_a_name_is_that_of_a_network_in_the_package(path, tmp_path, monkeypatch, generator):
    weights = tmp_path / "weights"
    monkeypatch.setattr("pnpct.files.named_denoisers.WEIGHTS", weights)
    assert network_names() == ()
    with pytest.raises(ValueError, match=f'no denoiser "n2n"; there are {", ".join(DENOISERS)}, .safetensors'):
        load_denoiser("n2n")
    weights.mkdir()
    for file in (path, sidecar_of(path)):
        shutil.copy(file, weights / file.name.replace("net", "n2n"))
    assert network_names() == ("n2n",)
    image = torch.rand(8, 8, generator=generator)
    torch.testing.assert_close(load_denoiser("n2n")(image), load_denoiser(path)(image))
    with pytest.raises(ValueError, match=f'no denoiser "supervised"; there are {", ".join(DENOISERS)}, n2n'):
        load_denoiser("supervised")


def test_the_noise_level_goes_to_noise_conditioned_networks(path, tmp_path):
    with pytest.raises(ValueError, match="not noise-conditioned"):
        load_denoiser(path, noise_level_hu=30.0)
    told = tmp_path / "told.safetensors"
    save_network(told, RDNCBAM(TINY, noise_input=True), about=SAID)
    with pytest.raises(ValueError, match="give noise_level_hu"):
        load_denoiser(told)


@pytest.mark.parametrize("name", ["n2n", "supervised"])
def test_the_networks_that_come_with_the_package_remove_noise(name: str) -> None:
    about = json.loads((network_file(name).parent / f"{name}.safetensors.json").read_text())["about"]
    assert about["licence"] == "Apache-2.0"
    assert about["manifest_sha256"]
    distance = torch.hypot(*torch.meshgrid(*2 * [torch.arange(128) - 63.5], indexing="ij"))
    truth = (distance < 50).float() + 0.1 * (distance < 20)
    frequency = torch.hypot(*torch.meshgrid(*2 * [torch.fft.fftfreq(128)], indexing="ij"))
    white = torch.randn(128, 128, generator=torch.Generator().manual_seed(1))
    noise = torch.fft.ifft2(torch.fft.fft2(white) * frequency).real  # as FBP colours it
    noisy = truth + 0.06 * noise / noise.std()
    denoised = load_denoiser(name)(noisy)
    inside = distance < 45
    assert (denoised - truth)[inside].square().mean() < 0.25 * (noisy - truth)[inside].square().mean()
    assert abs(float((denoised - truth)[inside].mean())) < 0.005
