"""Devices that tests run on, and pictures that they do not wait for."""

import functools

import pytest
import warp as wp
from helpers import tune_paths

from warp_pd.interfaces.context import find_device


@pytest.fixture(params=["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def device(request):
    """Name of a device: a CPU, and a GPU where there is one. `pytest -m gpu` runs the GPU set alone."""
    find_device(None)
    if request.param != "cpu" and not wp.is_cuda_available():
        pytest.skip("needs a GPU")
    return request.param


@pytest.fixture
def default_pictures():
    """Draw the pictures of scenes without a function for them."""


@pytest.fixture(autouse=True)
def no_default_pictures(request, monkeypatch):
    """Leave those pictures out where a test does not ask for them: they take longer than most runs."""
    if "default_pictures" not in request.fixturenames:
        monkeypatch.setattr("warp_pd.output.default_pictures.draw", lambda *arguments: None)


@pytest.fixture
def tune(monkeypatch):
    """`tune_paths`, for a test."""
    return functools.partial(tune_paths, monkeypatch)
