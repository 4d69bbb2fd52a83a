"""What the tests of modules share."""

import pytest
import warp as wp
from small_runs import BALL, cli

from warp_pd.device import graph
from warp_pd.laws import force_paths


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
    monkeypatch.setattr(force_paths, "shares_memory", lambda device: True)
    monkeypatch.setattr(graph, "SPLIT_FROM", float("inf"))
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    tune(compact_points=0)
