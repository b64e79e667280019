"""`pnpct denoise`, and trained networks in `pnpct reconstruct`."""

import json
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import torch
from mistakes import Case, check, cut, with_text

from pnpct.denoisers import RDNCBAM, REDCNN, RDNSize, denoiser_settings, make_denoiser
from pnpct.files import Provenance, load_denoiser, read_image, save_network, sha256_of, write_image
from pnpct.files.checkpoint import ABOUT
from pnpct.geometry import ImageGrid, VolumeGrid

TINY = RDNSize(features=4, growth=2, blocks=1, convolutions=2, unshuffle=2)


def save(path: Path, network: torch.nn.Module) -> Path:
    """Write a network that changes images by some HU."""
    generator = torch.Generator().manual_seed(2)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.1, generator=generator)
    save_network(path, network, about=dict.fromkeys(ABOUT))
    return path


def with_network(network: torch.nn.Module, *, sidecar: bool = True, **changes: object):
    """Write a network as net.safetensors, and change what is said about it."""

    def prepare(here: Path, made: Path) -> None:
        described = (path := save(here / "net.safetensors", network)).with_name(path.name + ".json")
        if sidecar:
            described.write_text(json.dumps(json.loads(described.read_text()) | changes))
        else:
            described.unlink()

    return prepare


def said_of(path: Path) -> Provenance:
    return Provenance.from_json(path.with_name(path.name + ".json").read_text())


@pytest.mark.parametrize(("name", "strength"), [("tv", 40.0), ("nonlocal-means", 60.0), ("gaussian", 1.5)])
def test_a_classical_denoiser_does_what_it_does_in_python(name, strength, run, made, tmp_path):
    out = tmp_path / "out.h5"
    status, said, err = run("denoise", made / "image.h5", out, "--denoiser", name, "--strength", strength)
    assert (status, err) == (0, "")
    assert said == f"Wrote {out}: 64 x 64 pixels of 3.906 mm.\n"
    (image, grid), (denoised, kept) = read_image(made / "image.h5"), read_image(out)
    assert kept == grid
    torch.testing.assert_close(denoised, make_denoiser(name, strength)(image), rtol=0, atol=1e-6)
    assert said_of(out).inputs == {str(made / "image.h5"): sha256_of(made / "image.h5")}
    assert denoiser_settings(make_denoiser(name, strength)).items() <= said_of(out).settings.items()


@pytest.mark.parametrize("told", [False, True])
def test_a_network_does_what_it_does_in_python(told, run, made, tmp_path):
    path = save(tmp_path / "net.safetensors", RDNCBAM(TINY, noise_input=told))
    out = tmp_path / "out.h5"
    words = ["--noise-level-hu", "30"] if told else []
    assert run("denoise", made / "image.h5", out, "--denoiser", path, "--device", "cpu", *words)[0] == 0
    image, _ = read_image(made / "image.h5")
    expected = load_denoiser(path, noise_level_hu=30.0 if told else None)(image)
    torch.testing.assert_close(read_image(out)[0], expected, rtol=0, atol=1e-6)
    assert (expected - image).abs().max() > 1e-3
    settings = said_of(out).settings
    assert settings["denoiser_sha256"] == sha256_of(path)
    assert settings["passes"] == 1
    assert settings.get("noise_level_hu") == (pytest.approx(30) if told else None)


def test_slices_of_nifti_are_denoised_each_and_keep_their_distance(run, tmp_path, generator):
    image, grid = (
        1 + 0.1 * torch.randn(3, 24, 20, generator=generator),
        VolumeGrid(ImageGrid(24, 20, 0.75), 3, 2.5, 80.0),
    )
    write_image(tmp_path / "in.nii.gz", image, grid, provenance=Provenance(["pnpct"], "0.1.0"))
    status, out, err = run(
        "denoise", tmp_path / "in.nii.gz", tmp_path / "out.nii", "--denoiser", "tv", "--strength", "20"
    )
    assert (status, err) == (0, "")
    assert out.endswith("out.nii: 3 slices 2.5 mm apart of 24 x 20 pixels of 0.75 mm.\n")
    affine = nib.load(tmp_path / "out.nii").affine
    assert np.diag(affine).tolist() == [0.75, 0.75, 2.5, 1.0]
    assert affine[2, 3] == 77.5
    denoised, kept = read_image(tmp_path / "out.nii")
    assert kept == grid
    for before, after in zip(image, denoised, strict=True):
        torch.testing.assert_close(after, make_denoiser("tv", 20.0)(before), rtol=0, atol=1e-4)


def test_reconstruct_takes_a_network(run, made, tmp_path):
    path, out = save(tmp_path / "net.safetensors", RDNCBAM(TINY)), tmp_path / "out.h5"
    words = ["reconstruct", made / "scan.h5", out, "--denoiser", path, "--iterations", "2"]
    status, _, err = run(*words)
    assert (status, err) == (0, "")
    settings = said_of(out).settings
    assert (settings["denoiser"], settings["denoiser_sha256"]) == (str(path), sha256_of(path))
    assert settings["passes"] == 1
    with_network, _ = read_image(out)
    assert run("reconstruct", made / "scan.h5", out, "--iterations", "2")[0] == 0
    assert (read_image(out)[0] - with_network).abs().max() > 1e-3


def test_a_network_of_the_package_goes_by_its_name(run, made, tmp_path, monkeypatch):
    path = save(tmp_path / "n2n.safetensors", RDNCBAM(TINY))
    monkeypatch.setattr("pnpct.files.named_denoisers.WEIGHTS", tmp_path)
    outs = {"n2n": tmp_path / "by-name.h5", path: tmp_path / "by-path.h5"}
    for denoiser, out in outs.items():
        assert run("denoise", made / "image.h5", out, "--denoiser", denoiser)[0] == 0
    by_name, by_path = (read_image(out)[0] for out in outs.values())
    torch.testing.assert_close(by_name, by_path, rtol=0, atol=1e-6)


def test_a_network_can_be_applied_twice(run, made, tmp_path):
    path, out = save(tmp_path / "net.safetensors", RDNCBAM(TINY)), tmp_path / "out.h5"
    assert run("denoise", made / "image.h5", out, "--denoiser", path, "--passes", "2")[0] == 0
    once = load_denoiser(path)
    image, _ = read_image(made / "image.h5")
    torch.testing.assert_close(read_image(out)[0], once(once(image)), rtol=0, atol=1e-6)


@pytest.mark.parametrize("command", ["denoise {made}/image.h5", "reconstruct {made}/scan.h5 --iterations 2"])
def test_a_network_can_compute_with_fewer_digits(command, run, made, tmp_path):
    path, outs = save(tmp_path / "net.safetensors", RDNCBAM(TINY)), [tmp_path / "exact.h5", tmp_path / "quick.h5"]
    name, scan, *rest = command.format(made=made).split()
    for out, words in zip(outs, ([], ["--bfloat16"]), strict=True):
        assert run(name, scan, out, "--denoiser", path, "--device", "cpu", *rest, *words)[0] == 0
        assert said_of(out).settings["bfloat16"] is bool(words)
    exact, quick = (read_image(out)[0] for out in outs)
    assert 0 < (quick - exact).square().mean().sqrt() < 0.01


def test_the_help_of_both_commands_says_that_a_file_will_do(run):
    for command in ("denoise", "reconstruct"):
        assert "FILE.safetensors" in run(command, "--help")[1]


CONDITIONED = with_network(RDNCBAM(TINY, noise_input=True))
GOOD = "denoise {made}/image.h5 {here}/out.h5"
TV = GOOD + " --denoiser tv"
PNP_TV = "reconstruct {made}/scan.h5 {here}/out.h5 --denoiser tv"
NETWORK = GOOD + " --denoiser {here}/net.safetensors"
PNP = "reconstruct {made}/scan.h5 {here}/out.h5 --denoiser {here}/net.safetensors"

MISTAKES = [
    Case("an unknown denoiser", GOOD + " --denoiser bm3d", "no denoiser bm3d tv nonlocal-means gaussian .safetensors"),
    Case("a negative strength", TV + " --strength -1", "strength from 0 up -1"),
    Case("a strength that is no number", TV + " --strength nan", "strength from 0 up nan"),
    Case("fewer digits of tv", TV + " --bfloat16", "bfloat16 no effect on tv networks"),
    Case("fewer digits of tv in pnp", PNP_TV + " --bfloat16", "bfloat16 tv networks"),
    Case("no image", "denoise {here}/bad.h5 {here}/out.h5", "There is no file bad.h5"),
    Case("an image cut short", "denoise {here}/bad.h5 {here}/out.h5", "bad.h5 truncated", cut(0.9, of="image.h5")),
    Case("a scan for an image", "denoise {made}/scan.h5 {here}/out.h5", "scan.h5 pnpct-scan pnpct-image needed"),
    Case("a picture for an image", "denoise {here}/a.png {here}/out.h5", "a.png 256 greys", with_text("a.png", "")),
    Case("an unknown format", "denoise {made}/image.h5 {here}/out.tiff", "out.tiff .h5 .nii"),
    Case("output over input", "denoise {here}/bad.h5 {here}/bad.h5", "bad.h5 is an input", cut(1.0, of="image.h5")),
    Case("no CUDA device", GOOD + " --device cuda", "--device cuda none --device cpu"),
    Case("no network", NETWORK, "There is no file net.safetensors"),
    Case("no network for pnp", PNP, "There is no file net.safetensors"),
    Case("text for a network", NETWORK, "net.safetensors.json copy both files", with_text("net.safetensors", "n2n")),
    Case("numbers alone", NETWORK, "without net.safetensors.json", with_network(RDNCBAM(TINY), sidecar=False)),
    Case("numbers alone for pnp", PNP, "without net.safetensors.json", with_network(RDNCBAM(TINY), sidecar=False)),
    Case("other numbers", NETWORK, "net.safetensors SHA-256", with_network(RDNCBAM(TINY), sha256="0" * 64)),
    Case("an unknown network", NETWORK, "unet rdn-cbam red-cnn", with_network(RDNCBAM(TINY), architecture="unet")),
    Case("another attention", NETWORK, "rdn-cbam attention both", with_network(RDNCBAM(TINY), attention="both")),
    Case("another size", NETWORK, "blocks.0 [3] [4]", with_network(RDNCBAM(TINY), size={**vars(TINY), "features": 3})),
    Case("HU from 0 to 1", NETWORK, "0..1 HU/1000 needed", with_network(RDNCBAM(TINY), normalisation="0..1")),
    Case("a newer version", NETWORK, "version 99 update pnpct", with_network(RDNCBAM(TINY), format_version=99)),
    Case(
        "no noise level",
        NETWORK,
        "noise-conditioned give noise_level_hu",
        CONDITIONED,
    ),
    Case(
        "no noise level for pnp",
        PNP,
        "noise-conditioned give noise_level_hu",
        CONDITIONED,
    ),
    Case(
        "a strength of a network",
        NETWORK + " --strength 30",
        "strength no effect net classical",
        with_network(RDNCBAM(TINY)),
    ),
    Case("passes of tv", TV + " --passes 2", "passes no effect tv networks"),
    Case("too many passes", NETWORK + " --passes 30", "1 to 4 times 30", with_network(RDNCBAM(TINY))),
    Case(
        "a negative noise level",
        NETWORK + " --noise-level-hu -3",
        "0 up -3",
        CONDITIONED,
    ),
    Case(
        "an image too small for the network",
        "denoise {here}/bad.h5 {here}/out.h5 --denoiser {here}/net.safetensors",
        "21 pixels 8 x 8",
        lambda here, made: (
            write_image(here / "bad.h5", torch.ones(8, 8), ImageGrid(8, 8, 1.0), provenance=Provenance([], "0")),
            save(here / "net.safetensors", REDCNN(filters=2)),
        ),
    ),
]


@pytest.mark.parametrize("case", MISTAKES, ids=lambda case: case.name)
def test_a_mistake_with_a_denoiser_gets_one_line_and_leaves_nothing_behind(case, run, made, tmp_path, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    check(case, run, made, tmp_path)
