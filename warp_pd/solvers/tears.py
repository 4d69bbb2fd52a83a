"""Load factor at which the energy of a damage field has a given value."""

from __future__ import annotations

import math
from collections.abc import Callable

# Accuracy of that energy, over its growth in a step, and largest number of trials, each way.
CLOSE, MOST_TRIALS = 1e-3, 40


def load_factor(excess: Callable[[float], float], here: float, stride: float, most: float) -> float | None:
    """Load factor at which an increasing function is zero, by the Illinois variant of regula falsi.

    Args:
        excess: The function; its value at the result is the last one computed.
        here: First guess.
        stride: First distance from there, which doubles until the zero is enclosed.
        most: Largest load factor; it is the result if the function is negative there.

    Returns:
        None if no zero is found.
    """
    a, at_a = here, excess(here)
    if abs(at_a) <= CLOSE or (here >= most and at_a < 0.0):
        return a
    b, at_b, step = a, at_a, math.copysign(stride, -at_a)
    for _ in range(MOST_TRIALS):
        a, at_a, b = b, at_b, min(b + step, most)
        at_b = excess(b)
        if at_a * at_b <= 0.0:
            break
        if b == most:
            return b
        step *= 2.0
    else:
        return None
    for _ in range(MOST_TRIALS):
        if abs(at_b) <= CLOSE or a == b:
            return b
        c = b - at_b * (b - a) / (at_b - at_a)
        at_c = excess(c)
        if at_c * at_b < 0.0:
            a, at_a = b, at_b
        else:
            at_a *= 0.5
        b, at_b = c, at_c
    return b
