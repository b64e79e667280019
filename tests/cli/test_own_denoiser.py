"""A denoiser of one's own through the commands."""

import json

from pnpct.files import load_network, read_image

SMALL = "--examples 1 --loop-iterations 1 --loop-images 1"


def test_it_reconstructs_and_denoises(run, made, tmp_path):
    named = "--denoiser", "my_networks:ADAPTED", "--noise-level-hu", "20"
    assert run("reconstruct", made / "scan.h5", tmp_path / "own.h5", *named, "--iterations", "1")[0] == 0
    settings = json.loads((tmp_path / "own.h5.json").read_text())["settings"]
    assert (settings["denoiser"], settings["noise_level_hu"]) == ("my_networks:ADAPTED", 20)
    assert run("denoise", made / "image.h5", tmp_path / "less.h5", *named)[0] == 0
    before, after = (read_image(path)[0] for path in (made / "image.h5", tmp_path / "less.h5"))
    assert abs(float((before - after).mean()) - 0.02) < 1e-4
    status, _, err = run("denoise", made / "image.h5", tmp_path / "no.h5", "--denoiser", "my_networks:NUMBER")
    assert (status, err.count("\n")) == (2, 1)
    assert "got 3" in err


def test_it_is_trained_written_and_used(run, made, dataset, tmp_path):
    path = tmp_path / "mine.safetensors"
    given = "--begin-with my_networks:Smoother --epochs 1 --fine-tuning-epochs 1 --pairs-per-epoch 1 --batch 1"
    assert run("train", dataset, path, *given.split(), *SMALL.split())[0] == 0
    described = json.loads(path.with_name("mine.safetensors.json").read_text())
    assert described["architecture"] == "my_networks:Smoother"
    assert type(load_network(path)).__name__ == "Smoother"
    assert run("denoise", made / "image.h5", tmp_path / "less.h5", "--denoiser", path)[0] == 0
