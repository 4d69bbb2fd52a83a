"""Ways to the same numbers, on every device: fast and reference kernels, lattice and cloud, a damage field."""

import numpy as np
import pytest
from curved_sheets import SHEETS, STATES, rotation, rough_motion, tear
from grid_sheets import holed, partly_off_the_grid
from helpers import GENT, build, internal_force, rough, sever, soften, square

from warp_pd import (
    CriticalStretch,
    TearingEnergy,
)

TOLERANCE = {32: 2e-6, 64: 1e-12}
CUT = ((0.02, 0.031), (0.071, 0.08))


def close(one, other, tolerance):
    assert np.abs(other).max() > 0.0
    assert np.abs(one - other).max() <= tolerance * np.abs(other).max()


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("torn", [False, True], ids=["undamaged", "torn"])
@pytest.mark.parametrize("cloud", [False, True], ids=["lattice", "cloud"])
@pytest.mark.parametrize("size", ["small", "large"])
def test_fast_paths_have_the_forces_of_the_reference(device, tune, size, cloud, torn, precision):
    """On a GPU small sheets share blocks; large ones have a kernel for undamaged families, and a list of the others."""
    if size == "large":
        tune(lattice_bonds=0, ring=300)
    sheet = square(33).as_cloud() if cloud else square(33)
    forces = []
    for fast in (True, False):
        parts = {"damage": CriticalStretch(1e3)} if torn else {}
        built = build(
            sheet, horizon=2.015, material=GENT, precision=precision, law={"fast": fast}, device=device, **parts
        )
        if torn:
            sever(built, CUT)
        on_gpu = "undamaged lattice" if size == "large" and not cloud else "blocks"
        assert built.law.force_path == ("reference" if not fast else "rows" if device == "cpu" else on_gpu)
        forces.append(internal_force(built, rough(sheet)))
    close(*forces, TOLERANCE[precision])


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("kind", SHEETS)
def test_fast_paths_of_curved_sheets_have_the_forces_of_the_reference(device, kind, state, precision):
    sheet, values, forces = SHEETS[kind](), STATES[state], []
    for fast in (True, False):
        law = {"fast": fast, **values.get("law", {})}
        built = build(sheet, horizon=2.2, material=GENT, precision=precision, device=device, **{**values, "law": law})
        if "damage" in values:
            assert soften(built).any() if built.context.layout.softened else tear(built).any()
        assert built.law.force_path == ("reference" if not fast else "rows" if device == "cpu" else "blocks")
        forces.append(internal_force(built, rough_motion(sheet)))
        turned = sheet.points @ rotation().T - sheet.points
        round_off = np.finfo(f"f{precision // 8}").eps * np.abs(turned).max()
        assert np.abs(internal_force(built, turned)).max() < 3.0 * round_off * GENT.constants[0] * sheet.thickness
    close(*forces, 5.0 * TOLERANCE[precision])


@pytest.mark.parametrize(
    ("size", "horizon", "precision", "torn"),
    [
        ("large", 2.015, 64, True), ("large", 1.5, 32, False), ("large", 3.15, 32, True), ("large", 3.15, 64, False),
        ("large", 4.15, 64, True), ("small", 3.15, 32, True), ("strips", 2.015, 32, False), ("strips", 3.15, 64, True),
    ],
)  # fmt: skip
def test_a_grid_with_gaps_has_the_forces_of_a_cloud(device, tune, size, horizon, precision, torn):
    if size != "small":
        tune(lattice_bonds=0)
    if size == "strips":
        tune(ring=900)
    sheet, forces = holed(65, 0.007), []
    for same, fast in ((sheet, True), (sheet.as_cloud(), False)):
        parts = {"damage": CriticalStretch(1e3)} if torn else {}
        built = build(
            same, horizon=horizon, material=GENT, precision=precision, law={"fast": fast}, device=device, **parts
        )
        if torn:
            sever(built, CUT)
        # At 4.15 families have more than 32 members, too many for the kernel of undamaged ones.
        large = device != "cpu" and size != "small" and horizon < 4.0
        assert (built.law.force_path == "undamaged lattice") == (fast and large)
        forces.append(internal_force(built, rough(sheet)))
    close(*forces, 2.0 * TOLERANCE[precision])


@pytest.mark.parametrize("precision", [32, 64])
def test_points_off_the_grid_have_the_forces_of_a_cloud(device, tune, precision):
    tune(lattice_bonds=0, ring=300)
    sheet = partly_off_the_grid(41)
    forces = [
        internal_force(build(s, weights=weights, precision=precision, device=device), rough(sheet))
        for s, weights in ((sheet, "corrected"), (sheet.as_cloud(), "corrected"))
    ]
    close(*forces, 2.0 * TOLERANCE[precision])


@pytest.mark.parametrize(("points", "cloud", "precision"), [(17, False, 32), (17, True, 64), (81, False, 32)])
def test_a_damage_field_is_that_of_a_cpu(device, points, cloud, precision):
    """On a GPU several threads share a family, and sweeps a launch, in which 81 x 81 points take several blocks."""
    sheet = square(points).cut((0.0, 0.05), (0.04, 0.05))
    pulled = (0.3 * rough(sheet) + 0.4 * sheet.positions * (0.0, 1.0, 0.0)).astype(f"f{precision // 8}")
    fields = []
    for where in (device, device, "cpu"):
        built = build(
            sheet.as_cloud() if cloud else sheet, horizon=3.15, material=GENT, precision=precision, device=where,
            damage=TearingEnergy(32.0 / (points - 1)),
        )  # fmt: skip
        damage = built.context.fields.in_restart()["damage_field"]
        at_start = damage.numpy().copy()
        built.state.displacement.assign(pulled)
        built.context.run("start")
        built.context.run("step")
        fields.append(damage.numpy())
    assert fields[0].tobytes() == fields[1].tobytes()
    assert np.abs(fields[2] - at_start).max() > 0.05
    close(fields[0], fields[2], 10.0 * TOLERANCE[precision])
