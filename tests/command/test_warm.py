"""warp-pd warm: what a run needs is compiled before it."""

import pytest
from small_runs import cli

from warp_pd import InputError
from warp_pd.command import warm
from warp_pd.device import launches

SCENE = """
from warp_pd import BondAssociated, Explicit, NeoHookean, Sheet, Simulation

def build():
    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=11)
    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5), horizon=1.5), Explicit(0.01, frames=1))
"""


def test_a_run_needs_no_module_that_warm_has_not_loaded(tmp_path, monkeypatch):
    scene = tmp_path / "small.py"
    scene.write_text(SCENE)
    loaded, load = set(), launches.load_module

    def seen(module, device, block_dim):
        loaded.add((module.name, block_dim))
        return load(module, device, block_dim)

    monkeypatch.setattr(launches, "load_module", seen)
    monkeypatch.setattr(launches, "is_loaded", lambda module, device, block_dim: False)
    done = cli("warm", str(scene), "--device", "cpu", "--quiet")
    assert done.exit_code == 0 and "kernels of 1 scene in" in done.output
    warmed = set(loaded)
    loaded.clear()
    assert cli("run", str(scene), "--device", "cpu", "--no-pictures", "--out", str(tmp_path / "out")).exit_code == 0
    assert loaded and loaded <= warmed


def test_a_scene_that_cannot_be_built_is_refused_if_named_and_left_out_among_all(monkeypatch, capfd):
    def refused(name, settings):
        raise InputError("newton is not installed")

    monkeypatch.setattr(warm, "scene_names", lambda: ["a"])
    monkeypatch.setattr(warm, "build_scene", refused)
    assert warm.warm([], "cpu", None, quiet=True)[0] == 0
    assert "a: left out, newton is not installed" in capfd.readouterr().out
    with pytest.raises(InputError, match="newton is not installed"):
        warm.warm(["pressure"], "cpu", None, quiet=True)
    unknown = cli("warm", "nothing")
    assert unknown.exit_code == 2
