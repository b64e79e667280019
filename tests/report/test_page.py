import json
import re
from dataclasses import replace

import pytest
from parsed_page import metrics, parse, read_number, resolve
from small_comparison import CHECKS, METHODS

from pnpct.comparison import Check, read_comparison
from pnpct.report import write_report
from pnpct.report.checks import method_checks
from pnpct.report.results import Results

SECTIONS = ["images", "summary", "checks", "curves", "lesions", "texture", "numbers", "data", "limits"]


@pytest.fixture(scope="module")
def page(report):
    return parse(report)


@pytest.fixture(scope="module")
def content(folder):
    return metrics(folder)


def test_all_sections_come_in_their_order(page):
    found = [element.attributes["id"] for element in page.all("section") if "id" in element.attributes]
    assert [name for name in found if name in SECTIONS] == SECTIONS
    for link in page.all("a"):
        assert page.all(id=link.attributes["href"].removeprefix("#")), link.attributes["href"]


def test_nothing_is_loaded_from_anywhere(report, page):
    text = report.read_text(encoding="utf-8")
    assert not [element for element in page.walk() if {"src", "srcset", "action", "background"} & {*element.attributes}]
    assert not page.all("link")
    assert set(re.findall(r"https?://[^\s\"'<]+", text)) == {"http://www.w3.org/2000/svg"}  # a name, not an address
    assert not [element for element in page.walk() if "style" in element.attributes]  # the policy allows none
    assert not re.search(r"@import|url\((?!#)|\beval\(|new Function|fetch\(|XMLHttpRequest|import\(", text)
    (policy,) = (meta.attributes["content"] for meta in page.all("meta") if "http-equiv" in meta.attributes)
    assert policy.startswith("default-src 'none'; script-src 'sha256-")


def test_every_number_is_in_metrics_json_where_it_says(page, content):
    shown = [element for element in page.walk() if element.tag == "data" and "data-path" in element.attributes]
    assert len(shown) > 200
    for element in shown:
        path = element.attributes["data-path"]
        expected = resolve(content, path) * float(element.attributes.get("data-scale", "1"))
        value, half = read_number(element.text)
        assert value == pytest.approx(expected, abs=1.000001 * half), path
        if "value" in element.attributes:
            assert float(element.attributes["value"]) == resolve(content, path)


def without_places(element) -> str:
    """The text of an element but for numbers that name their place, hashes and marks."""
    if "data-path" in element.attributes or element.tag == "code" or "mark" in element.classes:
        return ""
    return "".join(child if isinstance(child, str) else f";{without_places(child)};" for child in element.children)


def test_no_table_and_no_fact_holds_a_number_without_its_place(page, content):
    words = json.dumps(content, ensure_ascii=False)
    for cell in [*page.all("td"), *page.all("dd")]:
        for piece in re.findall(r"[^,;]*\d[^,;]*", without_places(cell)):
            assert piece.strip() in words, piece


def test_every_number_of_the_comparison_is_shown(page, content):
    shown = {element.attributes["data-path"] for element in page.walk() if "data-path" in element.attributes}
    for part in ("fidelity", "texture", "histogram"):
        for case, methods in content[part].items():
            for method, values in methods.items():
                expected = {f"/{part}/{case}/{method}/{name}" for name, value in values.items() if value is not None}
                assert expected <= shown
    for index, check in enumerate(content["checks"]):
        assert check["value"] is None or f"/checks/{index}/value" in shown
    for case, found in content["lesions"].items():
        for method in found:
            assert {f"/lesions/{case}/{method}/{name}" for name in ("recovered", "spill", "distant_hu")} <= shown


def test_what_does_not_exist_is_said_to_be_so(page):
    assert any(cell.text == "n/a" for cell in page.all("td"))  # the PSNR of the reference
    assert any(cell.text == "–" for cell in page.all("td"))  # the interval of one feature


def test_texture_is_told_apart_by_tube_current_with_its_patients(page):
    text = " ".join(page.all("section", id="texture")[0].text.split())
    first, second = text.index("At 40 mA Patients: 6. Patches: 42."), text.index("At 60 mA Patients: 2. Patches: 14.")
    assert first < second
    assert "over-smoothed last: PnP-ADMM, Blurred FBP (control)." in text[first:second]
    assert "over-smoothed last" not in text[second:]  # closeness is not known there
    assert "Over-smoothed: Blurred FBP (control) (entropy)" in text[first:second]


def test_tables_of_texture_have_the_reference_its_repeat_and_the_truth(page):
    (table,) = [
        each for each in page.all("table") if each.all("caption")[0].text == "Change of texture from FBP, 40 mA"
    ]
    assert table.all("th", scope="row")[0].text.strip() == "Blurred FBP (control)"
    heads = [
        [head.text.strip() for head in each.all("thead")[0].all("th")]
        for each in page.all("section", id="numbers")[0].all("table")
        if "Contrast" in each.text
    ]
    assert heads == 2 * [["FBP", "Blurred FBP (control)", "PnP-ADMM", "Reference", "Second reference scan", "Truth"]]


def test_limits_have_the_digits_of_their_values(folder):
    check = Check("lesion recovery", "chest", "pnp", 1.0123456789, 0.8, 1.1234567890123, "pass", "It is whole.")
    comparison = replace(read_comparison(folder), checks=(check,))
    ((judged,),) = [table.all for table in method_checks(Results(comparison))]
    assert [re.sub("<[^>]*>", "", words) for words in (judged.value, judged.allowed)] == ["1.012", "0.8 to 1.123"]


def test_times_are_said_to_be_no_measurement(page):
    rows = [row.all("th")[0].text for row in page.all("tr") if "/cases/0/images/fbp/seconds" in paths_of(row)]
    assert rows == ["Time, beside other work on the same processor s"]


def paths_of(element):
    return {each.attributes.get("data-path") for each in element.walk()}


def test_a_map_has_one_scale_in_a_case(page):
    data = json.loads(page.all("script", id="viewer-data")[0].text)
    chest, head = data["cases"]
    assert chest["scales"] == {
        "t": {"signed": True, "largest": 8.0, "beyond": True},  # up to 16 in the image of the control
        "verifiable_hu": {"signed": False, "largest": 38.0, "beyond": False},
        "difference_hu": {"signed": True, "largest": 12.0, "beyond": False},
    }
    assert head["scales"] == {}


def test_the_summary_has_a_row_for_each_method_and_nothing_can_fold_it(page):
    (table,) = page.all("table", style="summary")
    rows = [" ".join(row.all("th")[0].text.split()) for row in table.all("tr")[1:]]
    assert rows == ["PnP-ADMM least error", "FBP baseline", "Blurred FBP (control)"]
    assert "details" not in [element.tag for element in table.ancestors()]
    (control,) = table.all("tr", style="control")
    assert "Blurred FBP" in control.text
    for word in ("Error", "Sharpness", "Lesion contrast", "Misfit to the data", "Marks"):
        assert f"{word}:" in page.all("ul", style="explained")[0].text


def test_every_check_is_there_once_folded_under_its_method(page):
    for check in CHECKS:
        (said,) = [each for each in page.all(style="check") if check.says in each.text]
        assert said.all(style="mark")[0].classes == {"mark", check.verdict.replace(" ", "-")}
        (fold,) = [element for element in said.ancestors() if element.tag == "details"]
        label = {method.name: method.label for method in METHODS}.get(check.method, "All methods")
        assert label in fold.all("summary")[0].text
    assert len(page.all(style="check")) == len(CHECKS)


def test_case_names_stand_in_the_head_of_the_checks_and_in_no_row(page):
    for table in page.all("table", style="checks"):
        assert "Head, 60 mA" not in table.all("tbody")[0].text
    heads = [head.text for head in page.all("table", style="checks")[0].all("th", scope="col")]
    assert heads == ["Chest, 40 mA", "Head, 60 mA"]


def test_the_count_of_verdicts_stands_beside_the_method(page):
    (summary,) = [each for each in page.all("summary") if "PnP-ADMM" in each.text]
    marks = [" ".join(mark.text.split()) for mark in summary.all(style="mark")]
    assert marks == ["✕failed 1", "✓passed 2"]


def test_tables_have_captions_and_scopes(page):
    for table in page.all("table"):
        assert table.all("caption")[0].text.strip()
        assert all("scope" in head.attributes for head in table.all("th"))
    for drawing in page.all("svg"):
        if drawing.attributes.get("aria-hidden") != "true":
            assert drawing.attributes.get("aria-label") or page.all(id=drawing.attributes["aria-labelledby"])
    for field in [*page.all("input"), *page.all("select")]:
        assert [element for element in field.ancestors() if element.tag == "label"]


def test_methods_settings_seeds_and_fingerprints_are_shown(page, content):
    text = page.text
    for word in ("rdn-cbam", "ab" * 32, "0123456789ab", "pnpct compare scans", "984 views of 900 bins on an arc"):
        assert word in text
    for method in METHODS:
        assert method.label in text
    for case in content["cases"]:
        for image in case["images"].values():
            assert image["sha256"] in text


def test_the_truth_stands_beside_the_best_method_and_the_control_is_among_the_images(page):
    data = json.loads(page.all("script", id="viewer-data")[0].text)
    assert data["cases"][0]["order"] == ["truth", "pnp", "fbp", "fbp-blurred", "reference"]
    assert data["window"] == [30.0, 300.0]
    texts = [element for element in page.all("script") if element.attributes.get("type") == "text/plain"]
    # Five images of two cases with one truth, four maps, and one that three methods share.
    assert len(texts) == 14
    assert all(element.text for element in texts)


def test_the_first_windows_are_those_of_soft_tissue(page):
    buttons = [
        (b.attributes["data-level"], b.attributes["data-width"])
        for b in page.all("button")
        if "data-level" in b.attributes
    ]
    assert buttons == [("30", "300"), ("40", "400"), ("-600", "1500"), ("400", "1800"), ("40", "80")]


def test_the_same_comparison_gives_the_same_page(folder, report, tmp_path):
    assert write_report(folder, tmp_path / "again.html") == 1
    assert (tmp_path / "again.html").read_bytes() == report.read_bytes()


def test_a_window_needs_a_width(folder, tmp_path):
    with pytest.raises(ValueError, match=r"positive width in HU, got \(30.0, 0.0\)"):
        write_report(folder, tmp_path / "report.html", window=(30.0, 0.0))
    assert not [*tmp_path.iterdir()]


def test_the_fixture_is_whole(folder):
    comparison = read_comparison(folder)
    assert all((comparison.tasks, comparison.curves, comparison.lesions, comparison.checks))
