"""Fields of frames, and rows of the history between them, on every device."""

import numpy as np
import pytest
from curved_sheets import small_sphere
from helpers import NEO, build, exact_stress, jittered, square

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    Nodal,
    RigidBall,
    Simulation,
    TensionField,
)

ALL = ("stretch", "direction", "first_piola", "cauchy", "wrinkle_state", "bonds")
F = np.array([[1.6, 0.3], [0.1, 1.2], [0.2, -0.1]])
CASES = {
    "lattice": (lambda: square(11), {}),
    "cloud torn": (lambda: jittered(11), {"damage": CriticalStretch(9.0)}),
    "relaxed": (lambda: square(11), {"material": TensionField(NEO)}),
}


def shown_at(built, displacement):
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))
    built.context.run("setup")
    built.context.run("frame")
    return {s.field.output: s.array.numpy() for s in built.context.fields.shown()}


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("case", CASES)
def test_uniform_states_are_exact(case, precision, device):
    make, parts = CASES[case]
    sheet = make()
    shown = shown_at(
        build(sheet, precision=precision, device=device, fields=ALL, **parts), sheet.points @ (F - np.eye(3)[:, :2]).T
    )
    tolerance = {32: 2e-5, 64: 1e-10}[precision]
    stretches, stresses = (np.linalg.svd(tensor)[1] for tensor in (F, exact_stress(NEO, F)))
    for k in (0, 1):
        assert shown[f"stretch_{k + 1}"] == pytest.approx(stretches[k], rel=tolerance)
        assert shown[f"first_piola_{k + 1}"] == pytest.approx(stresses[k], rel=tolerance)
    assert (shown["wrinkle_state"] == 0).all() and (shown["broken_bonds"] == 0).all()


def test_curved_and_nodal_fields_are_those_of_a_cpu(device):
    sphere = small_sphere(8)
    material = MooneyRivlin(2e5)
    for sheet, law in ((sphere, BondAssociated(material)), (square(11), Nodal(NEO))):
        move = 0.3 * sheet.points if sheet is sphere else sheet.points @ (F - np.eye(3)[:, :2]).T
        found = []
        for where in ("cpu", device):
            built = Simulation(sheet, law, Explicit(1.0), fields=ALL).build(where, 64)
            built.context.compile()
            found.append(shown_at(built, move))
        for name in ("stretch_1", "stretch_2", "first_piola_1", "cauchy_2", "intact_bonds"):
            np.testing.assert_allclose(found[1][name], found[0][name], rtol=1e-10, atol=1e-6)


def test_rows_between_frames_change_no_bit(device):
    sheet = square(15)
    runs = [
        Simulation(
            sheet,
            BondAssociated(NEO, horizon=2.015),
            Explicit(0.02, frames=4, history_every=every),
            loads=[Fixed(sheet.edges("all"))],
            damage=CriticalStretch(1.3),
            contact=RigidBall(0.03, (0.05, 0.05, 0.016), (0.0, 0.0, -2.0)),
        ).run(device=device)
        for every in (None, 3e-4)
    ]
    assert runs[0].frame.displacement.tobytes() == runs[1].frame.displacement.tobytes()
    assert runs[0].history == runs[1].history and len(runs[1].fine_history) > 20
