"""`pnpct reconstruct` of a volume, by two processes, killed at random and started again: the same bytes."""

import os
import random
import shutil
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest
from cone_scans import HELIX, scan_of_water
from killing import contents, finish, start

from pnpct.files import Provenance, write_scan

OPTIONS = "--method tv --slices 24 --slice-spacing 0.5 --size 48 --field-of-view 240 --processes 2"
KILLS = int(os.environ.get("PNPCT_KILLS_OF_VOLUMES", "10"))


def wait_for_the_end_of(group: int):
    """Until its processes, workers of a killed one among them, are gone."""
    end = time.monotonic() + 60
    with suppress(ProcessLookupError):
        while time.monotonic() < end:
            os.killpg(group, 0)
            time.sleep(0.05)
        raise AssertionError("workers have outlived the process that wanted their work")


@pytest.mark.slow
@pytest.mark.parametrize("output", ["out.h5", "series/"])
def test_a_volume_is_resumed_whenever_it_was_killed(output, tmp_path):
    write_scan(tmp_path / "scan.h5", scan_of_water(HELIX), provenance=Provenance(["pnpct"], "0.1.0"))
    words = ["reconstruct", "../scan.h5", output, *OPTIONS.split()]
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    whole.mkdir()
    begin = time.monotonic()
    finish(words, cwd=whole)
    takes = time.monotonic() - begin
    chance, kills, ends = random.Random(1), 0, 0
    while kills < KILLS:
        killed.mkdir(exist_ok=True)
        with start(words, cwd=killed) as process:
            time.sleep(chance.uniform(0.2, 1.0) * takes)
            process.send_signal(signal.SIGKILL)
            _, err = process.communicate(timeout=60)
        wait_for_the_end_of(process.pid)
        if process.returncode == -signal.SIGKILL:
            kills += 1
        else:
            assert process.returncode == 0, err
            same(whole, killed)
            ends += 1
    finish(words, cwd=killed)
    same(whole, killed)
    print(f"{kills} kills, {ends} ends")


def same(whole: Path, killed: Path):
    """What was begun again is what was not; nor is anything left of what was begun."""
    assert contents(killed) == contents(whole)
    shutil.rmtree(killed)
    killed.mkdir()
