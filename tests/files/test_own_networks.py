"""Networks of a user's own: by where they can be imported from, and in files."""

import json
import sys

import my_networks
import pytest
import torch

from pnpct.denoisers import Gaussian, LearnedDenoiser
from pnpct.files import FileFormatError, imported_network, load_denoiser, load_network, save_network
from pnpct.files.checkpoint import ABOUT

SAID = dict.fromkeys(ABOUT)


def disturbed(network: torch.nn.Module) -> torch.nn.Module:
    generator = torch.Generator().manual_seed(4)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.3, generator=generator)
    return network


@pytest.mark.parametrize("name", ["Smoother", "make", "ADAPTED"])
def test_a_network_of_ones_own_is_written_and_read(name, tmp_path, generator):
    path, where = tmp_path / "own.safetensors", f"my_networks:{name}"
    network = disturbed(imported_network(where))
    save_network(path, network, about=SAID)
    found = load_network(path)
    assert {key: value.dtype for key, value in found.state_dict().items()} == {
        key: value.dtype for key, value in network.state_dict().items()
    }
    level = 20.0 if name == "ADAPTED" else None
    image = 1 + 0.1 * torch.randn(2, 9, 11, generator=generator)
    by_file = load_denoiser(path, noise_level_hu=level)
    torch.testing.assert_close(by_file(image), LearnedDenoiser(network, noise_level=level and level / 1000)(image))
    # It knows where it came from, and is written again.
    save_network(tmp_path / "again.safetensors", found, about=SAID)
    assert (tmp_path / "again.safetensors").read_bytes() == path.read_bytes()


def test_what_is_imported_is_a_copy():
    network = disturbed(imported_network("my_networks:ADAPTED"))
    assert network.network.scale.item() != my_networks.ADAPTED.network.scale.item() == 1


def test_a_denoiser_is_named_by_where_it_is(generator):
    image = 1 + 0.1 * torch.randn(9, 11, generator=generator)
    assert load_denoiser("my_networks:BLUR") == Gaussian(0.5)
    shrunk = load_denoiser("my_networks:ADAPTED", noise_level_hu=30.0)
    torch.testing.assert_close(shrunk(image), image - 0.03)  # 0.015 of a range of 2000 HU
    assert shrunk.settings["denoiser"] == "my_networks:ADAPTED"
    assert len(shrunk.settings["denoiser_sha256"]) == 64


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("my_networks:ADAPTED", {}, "ADAPTED is noise-conditioned: give noise_level_hu"),
        ("my_networks:Smoother", {"noise_level_hu": 3.0}, "takes no noise level"),
        ("my_networks:Smoother", {"strength": 3.0}, "strength has no effect"),
        ("my_networks:BLUR", {"passes": 2.0}, "passes has no effect on my_networks:BLUR, which is no network"),
        ("my_networks:NUMBER", {}, "must be a torch.nn.Module or a function from image to image, got 3"),
        ("my_networks:absent", {}, "cannot be imported as a denoiser: AttributeError"),
        ("no_such_module:net", {}, "cannot be imported as a denoiser: ModuleNotFoundError"),
    ],
)
def test_what_is_no_denoiser_is_said_in_one_sentence(name, options, words):
    with pytest.raises(ValueError, match=words):
        load_denoiser(name, **options)


@pytest.mark.parametrize(
    ("architecture", "words"),
    [
        (None, "say by architecture where Smoother can be imported from"),
        ("Smoother", 'is like "my_package.module:name"'),
        ("my_networks:make", "lacks network.bias and 1 more|holds"),
        ("my_networks:make_untold", "no function that says -> nn.Module"),
        ("my_networks:NUMBER", "no class of one"),
        ("os:abort", "no class of one"),
    ],
)
def test_a_network_that_could_not_be_read_is_not_written(architecture, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        save_network(tmp_path / "own.safetensors", my_networks.Smoother(), about=SAID, architecture=architecture)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("named", ["not_installed:Net", "os:abort", "my_networks:make_untold"])
def test_a_file_calls_nothing_that_is_no_network(named, tmp_path, monkeypatch):
    path = tmp_path / "own.safetensors"
    save_network(path, my_networks.Smoother(), about=SAID, architecture="my_networks:Smoother")
    sidecar = path.with_name(path.name + ".json")
    sidecar.write_text(json.dumps(json.loads(sidecar.read_text()) | {"architecture": named}))
    (tmp_path / "not_installed.py").write_text("raise SystemExit('a module beside a file is not run')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [folder for folder in sys.path if folder])  # as in a new process
    with pytest.raises(FileFormatError, match=f"described as {named}, which cannot be used"):
        load_network(path)
