"""Processes forked after a run can run: neither threads nor CUDA come along."""

import multiprocessing
import os

import pytest
from helpers import NEO, square

from warp_pd import BondAssociated, Explicit, Fixed, InputError, Newton, Simulation
from warp_pd.context import find_device
from warp_pd.device import cores


def status(solver):
    sheet = square(7)
    scene = Simulation(sheet, BondAssociated(NEO), solver, [Fixed(sheet.edges()), Fixed(range(sheet.size), "z")])
    return scene.run(device="cpu").status


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_pool_after_a_run_works():
    solvers = [Explicit(1e-4, frames=1), Newton(load_steps=1)]
    assert [status(solver) for solver in solvers] == ["finished"] * 2
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(status, solvers).get(timeout=120) == ["finished"] * 2


def test_a_forked_process_says_that_cuda_does_not_work_there(monkeypatch):
    monkeypatch.setattr(cores, "_cuda_was_there", True)
    monkeypatch.setattr("warp.is_cuda_available", lambda: True)
    for name in (None, "cuda", "cuda:0"):
        with pytest.raises(InputError, match="expected the start method 'spawn' or 'forkserver'"):
            find_device(name)
    assert find_device("cpu").is_cpu
