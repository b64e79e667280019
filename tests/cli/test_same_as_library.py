"""The command line and three lines of Python give the same image, with the same defaults."""

import pytest
import torch

from pnpct.cli import main
from pnpct.denoisers import DENOISERS
from pnpct.files import Provenance, load_denoiser, network_names, read_image, read_scan, read_truth
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, TVPWLS, DenoisedFBP, PlugAndPlay

METHODS = {
    "--method fbp": lambda: FBP(),
    "--method tv": lambda: TVPWLS(),
    "": lambda: PlugAndPlay(load_denoiser()),
    **{f"--denoiser {name}": lambda name=name: PlugAndPlay(load_denoiser(name)) for name in network_names()},
    **{f"--denoiser {name}": lambda name=name: PlugAndPlay(load_denoiser(name)) for name in DENOISERS},
}
NAMES = (*network_names(), *DENOISERS)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("small") / "scan.h5"
    body = ["--anatomy", "head", "--size", "32", "--views", "40", "--bins", "50"]
    assert main(["simulate", "scan", str(path), *body]) == 0
    return path


@pytest.fixture(scope="module")
def world(file):
    scan, (_, grid) = read_scan(file), read_truth(file)
    return take_log(scan), Projector(grid, scan.geometry, mu_water=scan.mu_water)


@pytest.mark.parametrize("words", METHODS)
def test_reconstruct_is_the_method_with_its_own_defaults(words, world, run, file, tmp_path):
    out = tmp_path / "out.h5"
    assert run("reconstruct", file, out, "--device", "cpu", *words.split())[0] == 0
    expected = METHODS[words]()(*world)
    assert torch.equal(read_image(out)[0], expected.image)
    settings = Provenance.from_json(out.with_name("out.h5.json").read_text()).settings
    assert expected.settings.items() <= settings.items()


@pytest.mark.parametrize("name", NAMES)
def test_denoise_is_the_denoiser_alone(name, world, run, file, tmp_path):
    sharp, out = tmp_path / "sharp.h5", tmp_path / "out.h5"
    assert run("reconstruct", file, sharp, "--method", "fbp", "--kernel", "ram-lak")[0] == 0
    assert run("denoise", sharp, out, "--device", "cpu", "--denoiser", name)[0] == 0
    expected = DenoisedFBP(load_denoiser(name))(*world).image
    torch.testing.assert_close(read_image(out)[0], expected, rtol=0, atol=1e-5)  # 0.01 HU
