"""Accuracy of divisions in the innermost loops of materials."""

import numpy as np
import pytest
import warp as wp

from warp_pd.kernels.effects import unstaged
from warp_pd.kernels.numeric import division, numeric


def quotient_kernel(bits):
    quotient = division(bits)
    real = numeric(bits).real

    @unstaged
    def divide(a: wp.array(dtype=real), b: wp.array(dtype=real), result: wp.array(dtype=real)):
        i = wp.tid()
        result[i] = quotient(a[i], b[i])

    return divide


@pytest.mark.parametrize("bits", [32, 64])
def test_quotients_are_accurate_to_two_units_in_the_last_place(bits, device):
    real = numeric(bits).real
    rng = np.random.default_rng(0)
    a, b = (
        (rng.choice([-1.0, 1.0], 100_000) * 10.0 ** rng.uniform(-12.0, 12.0, 100_000)).astype(wp.dtype_to_numpy(real))
        for _ in range(2)
    )
    result = wp.zeros(len(a), dtype=real, device=device)
    given = [wp.array(values, device=device) for values in (a, b)]
    wp.launch(quotient_kernel(bits), dim=len(a), inputs=[*given, result], device=device)
    exact = a.astype(np.longdouble) / b.astype(np.longdouble)
    assert (np.abs(result.numpy() - exact) <= 2.0 * np.spacing(np.abs(a / b))).all()


def test_divisions_by_zero_are_not_finite(device):
    result = wp.zeros(1, dtype=wp.float64, device=device)
    given = [wp.array([value], dtype=wp.float64, device=device) for value in (1.0, 0.0)]
    wp.launch(quotient_kernel(64), dim=1, inputs=[*given, result], device=device)
    assert not np.isfinite(result.numpy()).any()
