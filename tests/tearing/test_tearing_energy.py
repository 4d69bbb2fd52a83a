"""Tears by a critical stretch and by a tearing energy: their energy, and a strip that tears at it."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers import GENT, NEO, build, internal_force, refused, square, uniform

from warp_pd import (
    ArrudaBoyce,
    Bimodular,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    Simulation,
    TearingEnergy,
    TensionField,
    Yeoh,
)
from warp_pd.materials import energy_density
from warp_pd.scenes import pure_shear_tear
from warp_pd.tearing.damage_field import refuse_shared_device

MATERIALS = [NEO, GENT, MooneyRivlin(400.0, 100.0), Yeoh(500.0, 10.0), ArrudaBoyce(1e3, 5.0), TensionField(NEO)]


@pytest.mark.parametrize("material", MATERIALS[:5], ids=str)
def test_the_energy_density_is_the_work_of_the_stress(material):
    """Of pure shear, by integrating the force on a patch: an implementation apart from the energy function."""
    sheet, stretches = square(9), np.linspace(1.0, 2.0, 41)
    built = build(sheet, material=material, weights="corrected")
    right = sheet.points[:, 0] > 0.05
    loads = []
    for stretch in stretches:
        force = internal_force(built, uniform(sheet, [[stretch, 0.0], [0.0, 1.0], [0.0, 0.0]]))
        loads.append(-force[right, 0].sum() / (0.1 * sheet.thickness))
    assert float(energy_density(material, 2.0, 1.0)) == pytest.approx(np.trapezoid(loads, stretches), rel=2e-3)


def test_a_tip_that_waits_and_then_jumps_has_neither_speed_nor_released_energy():
    outcomes = {outcome.name: outcome.value for outcome in pure_shear_tear.build(points=16, advance=4.0).outcomes}
    waits = [{"time": float(t), "tip": 0.011 + 1e-5 * t, "rupture": 1e-5 * t * t} for t in range(10)]
    runs = [{"time": 10.0 + t, "tip": 0.011 + 7e-3 * t, "rupture": 2e-3 * 7e-3 * t} for t in range(8)]
    assert outcomes["released_ratio"](waits) is None and outcomes["crack_speed"](waits) is None
    assert abs(outcomes["released_ratio"](runs) - 1.0) < 1e-9 and abs(outcomes["crack_speed"](runs) - 7e-3) < 1e-9


def test_laws_without_an_energy_density_refuse_it():
    sheet = square(9)
    with refused(match=r"^damage = TearingEnergy: expected .*BondAssociated.*, got BondBased$"):
        Simulation(sheet, BondBased(Bimodular(1e3)), Explicit(1.0), damage=TearingEnergy(1.0)).build("cpu")


def test_breaking_takes_energy_and_torn_strips_keep_their_balance():
    """A notched strip torn in two at the default step. A single break may add energy still; all of them take it."""
    sheet = square(15).cut((-0.01, 0.049), (0.04, 0.049))
    bottom, top = sheet.edges("bottom"), sheet.edges("top")
    rough = np.random.default_rng(0).normal(size=(sheet.size, 3)) * [0.0, 0.0, 1e-5]
    rough[np.concatenate([bottom, top])] = 0.0
    result = Simulation(
        sheet, BondAssociated(TensionField(NEO), horizon=3.15), Explicit(3.0, frames=200, damping=2.0),
        loads=[Fixed(bottom), Motion(top, [0.0, 3.0], x=0.0, y=[0.0, 0.12], z=0.0)],
        damage=CriticalStretch(1.6, spared=np.concatenate([bottom, top])), initial_displacement=rough,
    ).run(device="cpu")  # fmt: skip
    assert result.status == "finished"
    losses = np.diff([row["rupture"] for row in result.history])
    assert losses[losses > 0.0].sum() > -50.0 * losses[losses < 0.0].sum()
    assert result.history[-1]["largest_damage"] > 0.4
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01


def test_a_pure_shear_strip_tears_near_its_tearing_energy():
    """Small and fast, which takes it beyond 1; docs/tearing.md measures it."""
    scene = pure_shear_tear.build(points=16, duration=2.0, frames=80, overload=1.4, advance=4.0, damage_length=0.0075)
    result = scene.run(device="cpu")
    assert result.status == "finished"
    measures = result.summary["measures"]
    assert 0.9 < measures["onset_ratio"]["value"] < 1.3
    assert measures["worst_energy_balance"]["value"] < 0.005


@pytest.mark.parametrize(("argument", "said"), [
    ({"points": 13}, "expected an even number"), ({"material": "steel"}, "material = 'steel'"),
    ({"wrinkles": "yes"}, "wrinkles = 'yes'"), ({"tearing_energy": -1.0}, "tearing_energy = -1.0"),
    ({"overload": 0.0}, "overload = 0.0"), ({"advance": -1.0}, "advance = -1.0"),
])  # fmt: skip
def test_wrong_arguments_of_the_strip_are_named(argument, said):
    with refused(match=said):
        pure_shear_tear.build(**argument)


def test_a_gpu_that_mps_shares_is_refused(tmp_path, monkeypatch):
    """Blocks that wait for each other, of several processes at once, stopped a GPU for good."""
    monkeypatch.setenv("CUDA_MPS_PIPE_DIRECTORY", str(tmp_path))
    gpu, cpu = (SimpleNamespace(is_cuda=cuda, alias=alias) for cuda, alias in ((True, "cuda:0"), (False, "cpu")))
    refuse_shared_device(gpu)
    (tmp_path / "control").touch()
    refuse_shared_device(cpu)
    with refused(match=r"^device = 'cuda:0': NVIDIA's MPS shares it .*: expected a GPU without MPS"):
        refuse_shared_device(gpu)
