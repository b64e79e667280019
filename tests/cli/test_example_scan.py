"""The example scan and the quick demo: what a user sees first."""

import pytest
import torch

from pnpct.files import read_scan, read_truth
from pnpct.simulation import example_scan


def test_the_example_scan_is_that_of_the_command(made):
    scan, truth, grid = example_scan("head", size=64, views=60, bins=100)
    written, (known, where) = read_scan(made / "scan.h5"), read_truth(made / "scan.h5")
    assert torch.equal(scan.counts, written.counts)
    assert (scan.geometry, scan.mu_water, grid) == (written.geometry, written.mu_water, where)
    assert torch.equal(truth, known)


def test_an_example_scan_of_no_anatomy_is_refused():
    with pytest.raises(ValueError, match=r'There is no anatomy "tail"; there are .*chest'):
        example_scan("tail")


@pytest.mark.parametrize(
    ("given", "scanned"),
    [
        ("--views 0", "--views 0 --size 512 --bins 900"),
        ("--quick --views 0", "--views 0 --size 256 --bins 450"),
        ("--quick --size 0", "--views 492 --size 0 --bins 450"),
    ],
)
def test_the_quick_demo_is_half_in_each_direction_where_nothing_else_is_said(given, scanned, run, tmp_path):
    status, out, err = run("demo", tmp_path, *given.split())
    assert (status, err.count("\n")) == (2, 1)  # the scan is refused, and nothing comes after it
    assert out == f"\n$ pnpct simulate scan {tmp_path / 'scan.h5'} {scanned} --tube-current-ma 40.0 --seed 0\n"
