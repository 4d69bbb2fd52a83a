"""The recorder: totals of a frame, and what writers and measures get."""

import numpy as np
import pytest
from helpers import NEO, Kept, build, rough, square

from warp_pd import BondAssociated, CriticalStretch, Explicit, Fixed, Measure, Pressure, RigidBall, Simulation


@pytest.mark.parametrize("points", [9, 16, 17, 33])
@pytest.mark.parametrize("precision", [32, 64])
def test_totals_are_the_sums_over_all_points(points, precision):
    sheet = square(points)
    built = build(
        sheet,
        precision=precision,
        loads=[Fixed(sheet.edges("left")), Pressure(1.0)],
        damage=CriticalStretch(3.0),
        contact=RigidBall(diameter=0.02, start=(0.05, 0.05, 1.0), velocity=(0.0, 0.0, -1.0)),
        solver=Explicit(1.0, damping=0.1),
        initial_displacement=rough(sheet),
    )
    rng, state = np.random.default_rng(1), built.state
    for array in (state.work, state.dissipated, built.rupture.released, built.contact.loss):
        array.assign(rng.normal(size=sheet.size))
    for array in (state.velocity, built.contact.impulse, built.contact.turn):
        array.assign(rng.normal(size=(sheet.size, 3)).astype(array.numpy().dtype))
    built.context.run("frame")
    arrays = {
        "kinetic": built.checks.kinetic_energy, "half_step_kinetic": built.checks.half_step_kinetic,
        "strain": built.law.strain_energy, "external": state.work,
        "damping": state.dissipated, "rupture": built.rupture.released, "ball_loss": built.contact.loss,
    }  # fmt: skip
    expected = {name: array.numpy() for name, array in arrays.items()}
    for name, vectors in (("impulse", built.contact.impulse), ("turn", built.contact.turn)):
        expected |= {f"ball_{name}_{c}": built.to_numpy(vectors)[:, k] for k, c in enumerate("xyz")}
    totals = built.sums.totals()
    assert totals.keys() == expected.keys()
    for name, values in expected.items():
        assert np.abs(values).max() > 0.0
        assert totals[name] == pytest.approx(values.sum(), rel=0, abs=1e-14 * np.abs(values).sum())


@pytest.mark.parametrize(("precision", "dtype"), [(32, np.float32), (64, np.float64)])
def test_writers_get_the_precision_of_the_run_and_measures_double(precision, dtype):
    sheet, dtypes = square(9), []
    kept = Kept(lambda frame: (frame, [frame.displacement.copy(), frame.velocity.copy(), frame.intact_faces.copy()]))

    def mean(built, frame):
        arrays = [frame.displacement, frame.velocity, frame.damage, *frame.point_data.values()]
        dtypes.extend(array.dtype for array in arrays)
        return frame.displacement[:, 2].mean()

    result = Simulation(
        sheet,
        BondAssociated(NEO, horizon=2.015),
        Explicit(0.02, frames=3),
        loads=[Fixed(sheet.edges("all")), Pressure(20.0)],
        damage=CriticalStretch(3.0),
        measures=[Measure("mean", "m", mean)],
    ).run(device="cpu", precision=precision, writers=[kept])
    frames = [frame for frame, _ in kept.all]
    assert set(dtypes) == {np.dtype(np.float64)} and result.frame.displacement.dtype == np.float64
    assert all(f.displacement.dtype == dtype and f.velocity.dtype == dtype for f in frames)
    assert result.history[-1]["mean"] == frames[-1].displacement[:, 2].astype(np.float64).mean() != 0.0
    np.testing.assert_array_equal(result.frame.velocity, frames[-1].velocity)
    # Frames stay what they were while the run goes on.
    for frame, copies in kept.all:
        for now, then in zip((frame.displacement, frame.velocity, frame.intact_faces), copies, strict=True):
            np.testing.assert_array_equal(now, then)
