import base64
import zlib

import numpy as np
import pytest

from pnpct.report.pixels import PackedPixels, pack_hu, pack_map


def unpack(packed: PackedPixels, cols: int) -> np.ndarray:
    """As the script of the page does it."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(packed.text)), np.uint8).reshape(2, -1).astype(np.int64)
    folded = planes[0] | (planes[1] << 8)
    differences = ((folded >> 1) ^ -(folded & 1)).reshape(-1, cols)
    return np.cumsum(differences, axis=1).astype(np.int16) * packed.step


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (64, 48)])
def test_pixels_come_back_as_whole_hu(shape):
    hu = np.random.default_rng(1).normal(0.0, 400.0, shape)
    np.testing.assert_array_equal(unpack(pack_hu(hu), shape[1]), np.rint(hu))


def test_the_largest_jumps_and_what_16_bits_do_not_hold():
    hu = np.array([[-32768.0, 32767.0, -32768.0, 1e6, -1e6, 0.4]])
    np.testing.assert_array_equal(unpack(pack_hu(hu), 6), [[-32768, 32767, -32768, 32767, -32768, 0]])


@pytest.mark.parametrize("largest", [8.37, 69.0, 0.004, 1000.0])
def test_maps_keep_a_hundredth_of_their_largest_value(largest):
    values = np.random.default_rng(1).uniform(-largest, largest, (16, 16))
    values[3, 4] = largest
    packed = pack_map(values)
    np.testing.assert_allclose(unpack(packed, 16), values, atol=0.5001 * packed.step)
    assert largest / 1000 <= packed.step <= largest / 99


def test_an_empty_map_is_all_0():
    np.testing.assert_array_equal(unpack(pack_map(np.zeros((4, 4))), 4), np.zeros((4, 4)))


def test_a_noisy_slice_stays_below_300_kilobytes():
    generator = np.random.default_rng(1)
    x, y = np.meshgrid(np.linspace(-1, 1, 512), np.linspace(-1, 1, 512))
    body = x**2 + (1.4 * y) ** 2 < 0.8
    hu = np.where(body, 40.0, -1000.0) + np.where(body, 30.0, 8.0) * generator.normal(size=x.shape)
    assert len(pack_hu(hu).text) < 300e3
