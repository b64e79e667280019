import json
from pathlib import Path

import pytest

from pnpct.files import MANIFEST, FileFormatError, ListedScan, Manifest, read_manifest, write_manifest

MADE = Manifest(
    {"seed": 1},
    [
        ListedScan("chest-000", "chest", 0, "train", [1.5], {"train/chest-000-row00.h5": "0" * 64}),
        ListedScan("chest-001", "chest", 1, "test", [2.5], {"test/chest-001-row00.h5": "1" * 64}),
    ],
)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    write_manifest(tmp_path, MADE)
    found = read_manifest(tmp_path)
    assert found == MADE
    assert found.files("test") == ("test/chest-001-row00.h5",)
    assert found.files("validation") == ()


def test_what_is_not_a_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_manifest(tmp_path)
    write_manifest(tmp_path, MADE)
    whole = json.loads((tmp_path / MANIFEST).read_text())
    for broken in (
        "{",
        "[]",
        "{}",
        json.dumps(whole | {"format": "other"}),
        json.dumps(whole | {"format_version": 2}),
        json.dumps(whole | {"scans": [{"name": "a"}]}),
        json.dumps(whole | {"scans": [whole["scans"][0] | {"files": {"../secret.h5": "0" * 64}}]}),
        json.dumps(whole | {"scans": 3}),
        "[" * 100_000,
    ):
        (tmp_path / MANIFEST).write_text(broken)
        with pytest.raises(FileFormatError, match="manifest"):
            read_manifest(tmp_path)
