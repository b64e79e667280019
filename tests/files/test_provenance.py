import hashlib
import json
import re
from importlib.metadata import version

import pytest

from pnpct.files import FileFormatError, Provenance, record_run, sha256_of, write_sidecar


@pytest.fixture
def provenance():
    return Provenance(
        ["pnpct", "simulate", "scan.h5"],
        "0.1.0",
        seed=7,
        inputs={"phantom.npz": hashlib.sha256(b"phantom").hexdigest()},
        settings={"tube_current_ma": 40.0, "window": (30, 300), "note": "Größe ≤ 1 µm"},
    )


def test_json_gives_the_same_provenance_again(provenance):
    assert Provenance.from_json(provenance.to_json()) == provenance


def test_the_json_is_readable_by_anybody(provenance):
    content = json.loads(provenance.to_json())
    assert content["command"] == ["pnpct", "simulate", "scan.h5"]
    assert content["settings"] == {"tube_current_ma": 40.0, "window": [30, 300], "note": "Größe ≤ 1 µm"}
    assert "µm" in provenance.to_json()


def test_the_fingerprint_is_that_of_the_bytes(tmp_path):
    path = tmp_path / "scan.h5"
    path.write_bytes(b"abc")
    assert sha256_of(path) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_a_fingerprint_needs_a_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=re.escape(f"There is no file {tmp_path / 'absent'}.")):
        sha256_of(tmp_path / "absent")
    with pytest.raises(IsADirectoryError, match="is a folder, but a file is needed"):
        sha256_of(tmp_path)


def test_a_run_is_recorded_with_version_and_inputs(tmp_path):
    path = tmp_path / "scan.h5"
    path.write_bytes(b"abc")
    run = record_run(["pnpct", "reconstruct"], inputs=[path], seed=3, settings={"beta": 0.3})
    assert run.version == version("pnpct")
    assert run.inputs == {str(path): sha256_of(path)}
    assert (run.seed, run.settings) == (3, {"beta": 0.3})


def test_the_sidecar_lies_beside_the_artefact(tmp_path, provenance):
    path = write_sidecar(tmp_path / "image.nii.gz", provenance)
    assert path == tmp_path / "image.nii.gz.json"
    assert Provenance.from_json(path.read_text(encoding="utf-8")) == provenance


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inputs": {"scan.h5": "abc"}}, "fingerprint of scan.h5 must be a SHA-256"),
        ({"settings": {"beta": float("nan")}}, "plain, finite values"),
        ({"settings": {"grid": object()}}, "plain, finite values"),
    ],
)
def test_impossible_values_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Provenance(["pnpct"], "0.1.0", **change)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "written in JSON"),
        ("[]", "a JSON object with named values was needed"),
        ('{"command": []}', "got command"),
    ],
)
def test_other_text_is_refused(text, message):
    with pytest.raises(FileFormatError, match=message):
        Provenance.from_json(text)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("command", "pnpct"),
        ("command", [1]),
        ("seed", "7"),
        ("inputs", {"a": 1}),
        ("version", 1),
    ],
)
def test_values_of_another_kind_are_refused(provenance, key, value):
    content = json.loads(provenance.to_json()) | {key: value}
    with pytest.raises(FileFormatError):
        Provenance.from_json(json.dumps(content))
