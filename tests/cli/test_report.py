"""`pnpct report` on a comparison of one image with itself."""

import json

import pytest
from mistakes import Case as Mistake
from mistakes import check, contents, with_text

from pnpct.comparison import Case, Check, ComparedMethod, Comparison, StoredImage, write_comparison
from pnpct.comparison.image_hash import image_sha256
from pnpct.files import Provenance, read_image, sha256_of

FAILED = Check("residual chi-square", "slice", "fbp", 2.0, 0.9, 1.1, "fail", "The image does not explain the data.")


def compare(made, folder, *checks):
    """Make a comparison of the FBP image in `made`, in a folder."""
    folder.mkdir(exist_ok=True)
    (folder / "fbp.h5").write_bytes((made / "image.h5").read_bytes())
    image, grid = read_image(folder / "fbp.h5")
    stored = {"fbp": StoredImage("fbp.h5", image_sha256(image, grid))}
    case = Case("slice", "a slice", 40.0, 120.0, grid, "a fan beam", (), stored)
    comparison = Comparison(
        Provenance(["pnpct"], "0"), {}, (ComparedMethod("fbp", "FBP", "baseline"),), (case,), checks=checks
    )
    write_comparison(folder, comparison)
    return folder


def test_a_report_and_its_panels_are_written_beside_the_results(run, made, tmp_path):
    folder = compare(made, tmp_path / "comparison")
    before = contents(folder)
    status, out, err = run("report", folder)
    assert (status, err) == (0, "")
    new = ["report.html", "panel.png", "panel.svg"]
    assert {*contents(folder)} - {*before} == {str(folder / name) for one in new for name in (one, f"{one}.json")}
    assert f"Wrote {folder / 'report.html'}: 1 case, no failed check.\n" in out
    said = json.loads((folder / "report.html.json").read_text())
    assert said["command"] == ["pnpct", "report", str(folder)]
    assert said["inputs"] == {str(folder / "metrics.json"): sha256_of(folder / "metrics.json")}


def test_it_says_how_many_checks_have_failed(run, made, tmp_path):
    folder = compare(made, tmp_path / "comparison", FAILED)
    status, out, _ = run("report", folder, tmp_path / "page.html", "--level", "40", "--width", "400")
    assert status == 0
    assert "1 case, 1 failed check.\n" in out
    page = (tmp_path / "page.html").read_text()
    assert '"window":[40.0,400.0]' in page
    assert FAILED.says in page


NOT_RESULTS = with_text("metrics.json", "{}")

OLD_RESULTS = with_text("metrics.json", '{"format": "pnpct-comparison", "format_version": 1}')

MISTAKES = [
    Mistake("no folder", "report {here}/none", "none cannot be written no folder"),
    Mistake("no results", "report {here} {here}/r.html", "There is no file metrics.json"),
    Mistake("other results", "report {here} {here}/r.html", "metrics.json not what a comparison writes", NOT_RESULTS),
    Mistake("an older version", "report {here} {here}/r.html", "metrics.json format version 1 reads 2", OLD_RESULTS),
    Mistake("another suffix", "report {here} {here}/report.pdf", "report.pdf must end in .html"),
    Mistake("no such place", "report {here} {here}/no/report.html", "no folder"),
]


@pytest.mark.parametrize("case", MISTAKES, ids=lambda case: case.name)
def test_mistakes(case, run, made, tmp_path):
    check(case, run, made, tmp_path)


def test_a_window_without_width_is_refused(run, made, tmp_path):
    folder = compare(made, tmp_path / "comparison")
    check(Mistake("no width", f"report {folder} --width 0", "positive width 0.0"), run, made, tmp_path)
