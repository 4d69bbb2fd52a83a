"""Devices that tests run on."""

import pytest
import warp as wp

from warp_pd.device.context import find_device


@pytest.fixture(params=["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def device(request):
    """Name of a device: a CPU, and a GPU where there is one. `pytest -m gpu` runs the GPU set alone."""
    find_device(None)
    if request.param != "cpu" and not wp.is_cuda_available():
        pytest.skip("needs a GPU")
    return request.param
