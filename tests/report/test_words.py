import pytest
from parsed_page import read_number

from pnpct.report.words import common_decimals, listed, spell, title_of, unit_of

VALUES = [0.0, 1.0, -3.14159, 41.23, 9.996, 999.4, 1314.19, -12345.6, 346200.0, 0.0004, 3.07e-9, -0.0275]


@pytest.mark.parametrize("value", VALUES)
@pytest.mark.parametrize("digits", [2, 3, 4])
def test_what_is_spelled_is_the_number_to_its_last_digit(value, digits):
    shown, half = read_number(spell(value, digits=digits))
    assert shown == pytest.approx(value, abs=half * 1.000001)
    # And that digit is fine enough for the digits asked for.
    assert half <= 0.5 * 10.0 ** (2 - digits) * max(abs(value), 1e-300) or half <= 0.5


@pytest.mark.parametrize(
    ("value", "text"), [(0.012345, "0.0123"), (-12345.6, "−12\u202f346"), (2.5, "2.50"), (0.0, "0"), (150.0, "150")]
)
def test_numbers_are_spelled_for_readers(value, text):
    assert spell(value) == text


def test_a_sign_may_be_asked_for():
    assert (spell(2.5, signed=True), spell(-2.5, signed=True), spell(0.0, signed=True)) == ("+2.50", "−2.50", "0")


@pytest.mark.parametrize(
    ("name", "title", "unit"),
    [
        ("soft_tissue_rmse_hu", "Soft tissue RMSE", "HU"),
        ("psnr", "PSNR", ""),
        ("f50_per_mm", "F50", "1/mm"),
        ("emd", "EMD", ""),
        ("hu", "HU", ""),
        ("psnr_ldctbench_chest", "PSNR ldct-bench chest", ""),
        ("ssim_lodopab_fr", "SSIM LoDoPaB FR", ""),
        ("psnr_40_400", "PSNR, window 40/400", ""),
        ("emd_to_truth_hu", "EMD to truth", "HU"),
    ],
)
def test_names_become_titles_and_units(name, title, unit):
    assert (title_of(name), unit_of(name)) == (title, unit)


@pytest.mark.parametrize(
    ("values", "decimals"),
    [
        ([121.4, 63.9, 8.8], 1),
        ([1234.5, -30.0], 0),
        ([1234.5, -3.0], None),
        ([23456.0, 1.0], None),
        ([0.0128, 0.0341], 5),
        ([0.5, 0.0004], None),
        ([0.751, 0.794], 4),
        ([0.0, None], 0),
        ([1e-9], None),
    ],
)
def test_a_row_of_numbers_ends_at_one_digit_unless_that_would_hide_some(values, decimals):
    assert common_decimals(values) == decimals
    if decimals is not None:
        for value in filter(None, values):
            assert abs(read_number(spell(value, decimals=decimals))[0]) > 0


@pytest.mark.parametrize(
    ("words", "text"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_words_are_joined_as_a_sentence_does(words, text):
    assert listed(words) == text
