import base64
import zlib

import numpy as np
import pytest

from pnpct.report.pixels import MAP_SIDE, NOTHING, PackedPixels, pack_hu, pack_map


def unpack(packed: PackedPixels, cols: int) -> np.ndarray:
    """As the script of the page does it."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(packed.text)), np.uint8).reshape(2, -1).astype(np.int64)
    folded = planes[0] | (planes[1] << 8)
    differences = ((folded >> 1) ^ -(folded & 1)).reshape(-1, cols)
    pixels = np.zeros((differences.shape[0] + 1, cols + 1), np.int64)
    for row, col in np.ndindex(differences.shape):
        left, above, between = pixels[row + 1, col], pixels[row, col + 1], pixels[row, col]
        foretold = sorted([left, above, left + above - between])[1]
        pixels[row + 1, col + 1] = (foretold + differences[row, col] + 32768) % 65536 - 32768
    known = pixels[1:, 1:]
    return np.where(known == NOTHING, np.nan, known * packed.step) if packed.step != 1.0 else known


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (64, 48)])
def test_pixels_come_back_as_whole_hu(shape):
    hu = np.random.default_rng(1).normal(0.0, 400.0, shape)
    np.testing.assert_array_equal(unpack(pack_hu(hu), shape[1]), np.rint(hu))


def test_the_largest_jumps_and_what_16_bits_do_not_hold():
    hu = np.array([[-32768.0, 32767.0, -32768.0, 1e6, -1e6, 0.4], [0.0, -1e6, 1e6, 3.0, 1e6, -1e6]])
    held = [[-32768, 32767, -32768, 32767, -32768, 0], [0, -32768, 32767, 3, 32767, -32768]]
    np.testing.assert_array_equal(unpack(pack_hu(hu), 6), held)


@pytest.mark.parametrize("largest", [8.37, 69.0, 0.004, 1000.0])
def test_maps_keep_a_hundredth_of_their_largest_value(largest):
    values = np.random.default_rng(1).uniform(-largest, largest, (16, 16))
    values[3, 4] = largest
    packed = pack_map(values)
    np.testing.assert_allclose(unpack(packed, 16), values, atol=0.5001 * packed.step)
    assert largest / 1000 <= packed.step <= largest / 99
    assert (packed.low, packed.high, packed.side) == (values.min(), values.max(), 1)


def test_where_a_map_is_not_finite_nothing_is_known():
    values = np.random.default_rng(1).uniform(-7.0, 7.0, (16, 16))
    unknown = np.zeros(values.shape, bool)
    unknown[2:9, 3:5] = unknown[15, 15] = True
    values[unknown] = np.resize([np.inf, -np.inf, np.nan], unknown.sum())
    packed = pack_map(values)
    found = unpack(packed, 16)
    np.testing.assert_array_equal(np.isnan(found), unknown)
    np.testing.assert_allclose(found[~unknown], values[~unknown], atol=0.5001 * packed.step)
    assert packed.high == values[~unknown].max()


def test_a_map_that_knows_nothing_can_be_packed():
    packed = pack_map(np.full((4, 4), np.inf))
    assert (packed.low, packed.high, packed.step) == (0.0, 0.0, 1.0)
    assert (unpack(packed, 4) == NOTHING).all()


def test_a_large_map_keeps_what_is_farthest_from_0_in_each_square():
    values = np.full((MAP_SIDE + 3, MAP_SIDE - 6), np.nan)
    values[:8, :6] = 0.25
    values[3, 2], values[2, 3], values[6, 5] = -4.0, 3.9, 1.0
    packed = pack_map(values)
    assert packed.side == 2
    found = unpack(packed, (MAP_SIDE - 6) // 2)
    assert found.shape == ((MAP_SIDE + 4) // 2, (MAP_SIDE - 6) // 2)
    np.testing.assert_allclose(found[:4, :3], [[0.25, 0.25, 0.25], [0.25, -4.0, 0.25], [0.25] * 3, [0.25, 0.25, 1.0]])
    assert np.isnan(found[5:]).all()


def test_an_empty_map_is_all_0():
    np.testing.assert_array_equal(unpack(pack_map(np.zeros((4, 4))), 4), np.zeros((4, 4)))


def test_a_noisy_slice_stays_below_300_kilobytes():
    generator = np.random.default_rng(1)
    x, y = np.meshgrid(np.linspace(-1, 1, 512), np.linspace(-1, 1, 512))
    body = x**2 + (1.4 * y) ** 2 < 0.8
    hu = np.where(body, 40.0, -1000.0) + np.where(body, 30.0, 8.0) * generator.normal(size=x.shape)
    assert len(pack_hu(hu).text) < 300e3
