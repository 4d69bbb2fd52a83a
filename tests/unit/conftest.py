"""What the tests of modules share."""

import pytest
from helpers import play_gpu
from small_runs import BALL, cli


@pytest.fixture(scope="session")
def ball(tmp_path_factory):
    """Folder of a small ball scene that tore; not to be changed."""
    folder = tmp_path_factory.mktemp("ball")
    done = cli("run", *BALL, "--frames", "24", "--out", folder)
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture
def gpu_paths(monkeypatch, tune):
    """Force paths of a GPU on a CPU, which runs blocks of threads one after the other."""
    play_gpu(monkeypatch)
    tune(compact_points=0)
