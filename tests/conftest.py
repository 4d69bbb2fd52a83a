"""Devices that tests run on, and what they do not wait for: pictures, and kernels of joined stages."""

import functools
import gc
import sys
from pathlib import Path

import pytest
import warp as wp
from helpers import play_gpu, tune_paths
from small_runs import BALL, cli

from warp_pd.__main__ import COLLECT_AFTER
from warp_pd.context import find_device
from warp_pd.device import launches

FOLDER = Path(__file__).parent
# As the command does: looking for cycles as often as Python does by default takes a twentieth of the time.
gc.set_threshold(COLLECT_AFTER)
# The files that take longest, longest first: begun last, one of them would run alone at the end.
LONGEST = (
    "scenes/test_scenes.py", "core/kernels/test_effects.py", "core/laws/test_force_paths.py",
    "distributed/test_processes.py", "tools/test_commands_of_docs.py", "contact/test_surface_contact.py",
    "contact/test_bodies.py", "tools/test_faults.py", "tools/test_notebooks.py", "statics/test_newton.py",
    "gpu/test_bits.py", "contact/test_ball_at_rest.py", "shapes/test_curved_sheets.py",
)  # fmt: skip


def pytest_collection_modifyitems(items):
    """Put the longest files first; the others keep their order."""
    places = {FOLDER / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path, len(places)))


@pytest.fixture(params=["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def device(request):
    """Name of a device: a CPU, and a GPU where there is one. `pytest -m gpu` runs the GPU set alone."""
    find_device(None)
    if request.param != "cpu" and not wp.is_cuda_available():
        pytest.skip("needs a GPU")
    return request.param


@pytest.fixture(autouse=True)
def import_path(monkeypatch):
    """The folders of scenes that a test loads, which Python searches first, are left out of the next tests."""
    monkeypatch.setattr(sys, "path", [*sys.path])


@pytest.fixture
def default_pictures():
    """Draw the pictures of scenes without a function for them."""


@pytest.fixture(autouse=True)
def no_default_pictures(request, monkeypatch):
    """Leave those pictures out where a test does not ask for them: they take longer than most runs."""
    if "default_pictures" not in request.fixturenames:
        monkeypatch.setattr("warp_pd.viewer.default_pictures.draw", lambda *arguments: None)


@pytest.fixture(autouse=True)
def few_pixels(request, monkeypatch):
    """Draw pictures of few pixels, in half the time, but in the tests of pictures."""
    if "viewer" not in request.path.relative_to(FOLDER).parts:
        for name in ("pictures.RESOLUTION", "pictures.RESOLUTION_IN_VECTORS", "plots.RESOLUTION_IN_VECTORS"):
            monkeypatch.setattr(f"warp_pd.viewer.{name}", 50)
        monkeypatch.setattr("warp_pd.viewer.film.DOTS", 30)


@pytest.fixture
def joined_stages():
    """Join pointwise stages as a run does."""


@pytest.fixture(autouse=True)
def stages_apart(request, monkeypatch):
    """Leave pointwise stages apart but for the commands of the documents and a GPU, unless a test asks for joined ones.

    Joined stages differ from scene to scene, and compiling them would take a fifth of the time of these tests.
    tests/core/device looks at how they are joined, tests/gpu/test_bits.py and tests/scenes/test_scenes.py hold them to
    the bits of the stages one by one, and the commands of the documents run them.
    """
    where = request.path.relative_to(FOLDER).parts
    as_users = where[-1] == "test_commands_of_docs.py" or "cuda" in request.node.name
    looked_at = as_users or where[:2] == ("core", "device") or "joined_stages" in request.fixturenames
    if not looked_at:
        monkeypatch.setattr(launches, "_joined", lambda first, second: None)


@pytest.fixture
def tune(monkeypatch):
    """`tune_paths`, for a test."""
    return functools.partial(tune_paths, monkeypatch)


@pytest.fixture(scope="session")
def ball(tmp_path_factory):
    """Folder of a small ball scene that tore; not to be changed."""
    folder = tmp_path_factory.mktemp("ball")
    done = cli("run", *BALL, "--frames", "24", "--out", folder)
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture
def gpu_paths(monkeypatch):
    """Force paths of a GPU on a CPU, which runs blocks of threads one after the other."""
    play_gpu(monkeypatch)
