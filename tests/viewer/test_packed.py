"""Numbers inside a page."""

import base64
import zlib

import numpy as np
import pytest

from warp_pd.viewer.view import Arrays


def unpacked(arrays, entry):
    """What the page makes of a series."""
    data = np.frombuffer(zlib.decompress(base64.b64decode(arrays.texts[entry["text"]])), np.uint8)
    low, high = data.reshape(2, *entry["shape"]).astype(np.int64)
    folded = low + 256 * high
    signed = (folded >> 1) ^ -(folded & 1)
    levels = np.cumsum(np.cumsum(signed, axis=1), axis=0) % 2**16
    return np.where(levels == 0, np.nan, entry["low"] + (levels - 1.0) * entry["step"])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("bits", [11, 16])
def test_a_series_is_right_to_half_a_level_and_keeps_what_is_missing(dtype, bits):
    values = np.random.default_rng(0).normal(-3.0, 1e-4, (5, 40)).astype(dtype)
    values[2, 7] = np.nan
    arrays = Arrays(bits)
    entry = arrays.add_series(values)
    found = unpacked(arrays, entry)
    assert np.isnan(found[2, 7]) and np.isnan(found).sum() == 1
    assert np.nanmax(np.abs(found - values)) <= 0.51 * (entry["high"] - entry["low"]) / (2**bits - 2)
    assert (entry["low"], entry["high"]) == (np.nanmin(values), np.nanmax(values))


@pytest.mark.parametrize("value", [0.0, 2.5, np.nan])
def test_a_series_of_one_value(value):
    arrays = Arrays()
    found = unpacked(arrays, arrays.add_series(np.full((3, 4), value)))
    np.testing.assert_array_equal(found, np.full((3, 4), value))


def test_truth_values_take_a_bit():
    arrays = Arrays()
    values = np.random.default_rng(0).random((3, 11)) > 0.5
    entry = arrays.add(values)
    packed = np.frombuffer(zlib.decompress(base64.b64decode(arrays.texts[0])), np.uint8).reshape(3, 2)
    np.testing.assert_array_equal(np.unpackbits(packed, axis=1, count=11, bitorder="little"), values)
    assert entry["kind"] == "bits"


def test_triangles_come_back():
    arrays = Arrays()
    corners = np.array([[0, 5, 2], [0, 1, 5], [3, 70_000, 4], [69_998, 69_999, 70_001]])
    entry = arrays.add_triangles(corners)
    found = np.frombuffer(zlib.decompress(base64.b64decode(arrays.texts[0])), "<u4").reshape(-1, 3).astype(np.uint32)
    found[:, 0] = np.cumsum(found[:, 0], dtype=np.uint32)
    found[:, 1:] += found[:, :1]
    np.testing.assert_array_equal(found, corners)
    assert entry["kind"] == "triangles"
