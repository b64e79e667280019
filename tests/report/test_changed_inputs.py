"""What the page says when the folder is not as it was, or some of it was never there."""

from dataclasses import replace

import pytest
import torch
from parsed_page import parse
from small_comparison import GRID, PROVENANCE

from pnpct.comparison import Check, ComparedMethod, Comparison, read_comparison, write_comparison
from pnpct.comparison.image_hash import image_sha256
from pnpct.files import read_image, write_image
from pnpct.geometry import ImageGrid
from pnpct.report import write_report


def write(folder, **changes):
    write_comparison(folder, replace(read_comparison(folder), **changes))


def test_an_image_with_one_other_pixel_fails_a_check(own_folder, tmp_path):
    image, grid = read_image(own_folder / "chest-pnp.h5")
    before = image_sha256(image, grid)
    image[5, 5] += 1e-3
    write_image(own_folder / "chest-pnp.h5", image, grid, provenance=PROVENANCE)
    assert write_report(own_folder, tmp_path / "report.html") == 2
    page = parse(tmp_path / "report.html")
    now = image_sha256(image, grid)
    (warned,) = page.all("header")[0].all("p", style="warning")
    (failed,) = [element for element in page.all(style="check") if before[:12] in element.text]
    for said in (warned, failed):
        assert f"was {before[:12]} and is {now[:12]}" in said.text
    assert "PnP-ADMM is not what was measured" in warned.text
    assert "details" not in [element.tag for element in warned.ancestors()]
    (row,) = [row for row in page.all("tr") if now in row.text]
    assert "no, changed" in row.text
    assert before not in [code.text for code in page.all("code")]


def test_a_changed_map_fails_a_check_too(own_folder, tmp_path):
    write_image(own_folder / "chest-t.h5", torch.zeros(64, 64), GRID, provenance=PROVENANCE)
    assert write_report(own_folder, tmp_path / "report.html") == 2  # and a map without a number in it can be shown
    assert "The map t has changed since it was measured" in parse(tmp_path / "report.html").text


def test_an_image_that_is_missing_is_named(own_folder, tmp_path):
    (own_folder / "head-truth.h5").unlink()
    with pytest.raises(FileNotFoundError, match=r"head-truth\.h5"):
        write_report(own_folder, tmp_path / "report.html")
    assert not (tmp_path / "report.html").exists()


def test_an_image_of_another_size_is_refused(own_folder, tmp_path):
    write_image(own_folder / "chest-fbp.h5", torch.zeros(32, 32), ImageGrid(32, 32, 8.0), provenance=PROVENANCE)
    with pytest.raises(ValueError, match=r"chest-fbp\.h5.*case chest has 64 x 64 pixels.*\(32, 32\)"):
        write_report(own_folder, tmp_path / "report.html")


def test_what_was_not_measured_has_no_section(own_folder, tmp_path):
    comparison = read_comparison(own_folder)
    bare = Comparison(comparison.provenance, {}, comparison.methods, comparison.cases)
    write_comparison(own_folder, bare)
    assert write_report(own_folder, tmp_path / "report.html") == 0
    page = parse(tmp_path / "report.html")
    assert [section.attributes["id"] for section in page.all("section")] == ["images", "data", "limits"]
    assert [link.attributes["href"] for link in page.all("nav")[0].all("a")] == ["#images", "#data", "#limits"]
    assert not page.all("svg", style="plot")


def test_a_comparison_without_cases_still_has_a_page(own_folder, tmp_path):
    comparison = read_comparison(own_folder)
    write_comparison(own_folder, Comparison(comparison.provenance, {}, comparison.methods, ()))
    assert write_report(own_folder, tmp_path / "report.html") == 0
    assert parse(tmp_path / "report.html").all("section", id="limits")


def test_words_from_the_comparison_cannot_become_code(own_folder, tmp_path):
    evil = '</script><img src=x onerror="alert(1)">&amp;'
    methods = (*read_comparison(own_folder).methods[:2], ComparedMethod("pnp", evil, "swept", {evil: evil}))
    check = Check(evil, "chest", "pnp", 1.0, None, None, "fail", evil)
    write(own_folder, methods=methods, checks=(check,), definitions={evil: evil})
    write_report(own_folder, tmp_path / "report.html")
    page = parse(tmp_path / "report.html")
    assert not page.all("img")
    assert page.text.count(evil) > 5
    scripts = page.all("script")
    assert [script.attributes.get("type", "") for script in scripts].count("") == 1


def test_texture_of_an_unknown_method_does_no_harm(own_folder, tmp_path):
    groups = read_comparison(own_folder).texture_change
    changes = {**groups["40 mA"].changes, "second reference": groups["40 mA"].changes["pnp"]}
    write(own_folder, texture_change={"40 mA": replace(groups["40 mA"], changes=changes)})
    write_report(own_folder, tmp_path / "report.html")
    assert "second reference" in parse(tmp_path / "report.html").text
