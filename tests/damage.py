"""Damage to files: changed bytes and words, and what a reader may do with them."""

import os
import re

from warp_pd import InputError

# Changes of each file.
TRIALS = int(os.environ.get("WARP_PD_FUZZ", "60"))
NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")
ODD = (b"", b"-1", b"0", b"nan", b"inf", b"x", b"1e308", b"1e-308", b"1e999", b"2147483648", b"99999999999", b"\xff")


def damaged(whole, rng):
    """Bytes of a file after a flip, a cut, an overwritten or a repeated piece."""
    data = bytearray(whole)
    place, length = int(rng.integers(len(data))), int(rng.integers(1, 64))
    kind = rng.integers(5)
    if kind == 0:
        del data[place:]
    elif kind == 1:
        data[place : place + length] = bytes(length)
    elif kind == 2:
        data[place:place] = data[place : place + length]
    else:
        for at in rng.integers(len(data), size=int(rng.integers(1, 8))):
            data[at] ^= 1 << int(rng.integers(8))
    return bytes(data)


def with_an_odd_number(whole, rng):
    """Bytes of a text after one of its numbers became another, or none."""
    numbers = list(NUMBER.finditer(whole))
    begin, end = numbers[int(rng.integers(len(numbers)))].span()
    return whole[:begin] + ODD[int(rng.integers(len(ODD)))] + whole[end:]


def require_one_line(read):
    """Whatever is read, or refused in one line."""
    try:
        read()
    except InputError as error:
        assert "\n" not in str(error) and len(str(error)) < 720, str(error)
