"""Frames: what the device sums up, checks and finds is what plain numpy finds; writers own what they get."""

import numpy as np
import pytest
from helpers import NEO, build, jittered, rough, sever, square

from warp_pd import BondAssociated, CriticalStretch, Explicit, Fixed, Measure, Pressure, RigidBall, Sheet, Simulation
from warp_pd.families import unpack
from warp_pd.run.runner import DivergedError, Recorder


def refresh(built):
    built.context.run("frame")


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
    for array in (state.work, state.dissipated, state.released):
        array.assign(rng.normal(size=sheet.size))
    for array in (state.velocity, built.contact.impulse):
        array.assign(rng.normal(size=(sheet.size, 3)).astype(array.numpy().dtype))
    refresh(built)
    arrays = {
        "kinetic": built.energy.kinetic, "strain": built.law.strain_energy, "external": state.work,
        "damping": state.dissipated, "rupture": state.released,
    }  # fmt: skip
    expected = {name: array.numpy() for name, array in arrays.items()}
    expected |= {f"impulse_{c}": built.to_numpy(built.contact.impulse)[:, k] for k, c in enumerate("xyz")}
    totals = built.totals()
    assert totals.keys() == expected.keys()
    for name, values in expected.items():
        assert np.abs(values).max() > 0.0
        assert totals[name] == pytest.approx(values.sum(), rel=0, abs=1e-14 * np.abs(values).sum())


@pytest.mark.parametrize("field", ["displacement", "velocity"])
@pytest.mark.parametrize("bad", [(0,), (255, 256), (288,), (280, 3)])
def test_the_first_point_that_is_not_finite_is_named(field, bad):
    built = build(square(17))
    values = np.zeros((17**2, 3))
    values[list(bad), 1] = np.inf if field == "velocity" else np.nan
    getattr(built.state, field).assign(values)
    with pytest.raises(DivergedError, match=f"point {min(bad)} at"):
        Recorder(built, []).frame(0, 0.0, 0, 0.0)


@pytest.mark.parametrize("precision", [32, 64])
def test_the_point_that_crosses_a_horizon_in_a_step_is_named(precision):
    built = build(square(17), precision=precision)
    velocity = np.random.default_rng(0).uniform(-1.0, 1.0, (17**2, 3))
    velocity[77] = (0.0, -3.0, 4.0)
    built.state.velocity.assign(velocity.astype(built.state.velocity.numpy().dtype))
    horizon = built.law.families.horizon
    Recorder(built, []).frame(0, 0.0, 0, 0.999 * horizon / 5.0)
    with pytest.raises(DivergedError, match="point 77 moves more than a horizon"):
        Recorder(built, []).frame(0, 0.0, 0, 1.001 * horizon / 5.0)


STRIP = Sheet.rectangle(0.1, 0.0125, thickness=1e-3, density=1000.0, points=(25, 4))


@pytest.mark.parametrize("horizon", [1.5, 3.0])
@pytest.mark.parametrize(
    "sheet", [square(13), STRIP, jittered(13, share=0.3), square(13).cut((0.01, 0.054), (0.06, 0.054))]
)
def test_a_face_is_torn_where_a_bond_along_its_edge_is_gone(sheet, horizon):
    built = build(sheet, horizon=horizon, damage=CriticalStretch(3.0))
    sever(built, ((0.0312, -0.01), (0.0529, 0.041)))
    families, alive = built.law.families, unpack(built.law.intact.numpy().T, built.law.families.members)
    whole, at = families.rows_of_points(families.exists), np.arange(sheet.size)
    head = families.neighbours if families.kind is None else at[:, None] + families.shift
    gone = {(i, head[i, k]) for i, k in np.argwhere(whole & ~alive)}
    expected = [not any((t[a], t[b]) in gone for a, b in ((0, 1), (1, 2), (2, 0))) for t in sheet.triangles]
    refresh(built)
    intact = built.to_host(built.intact).view(bool)
    np.testing.assert_array_equal(intact, expected)
    assert 0 < (~intact).sum() < len(intact)


class Keeper:
    """A writer that keeps its frames, and a copy of what they were."""

    def __init__(self):
        self.frames, self.copies = [], []

    def write(self, frame):
        self.frames.append(frame)
        self.copies.append([frame.displacement.copy(), frame.velocity.copy(), frame.intact_faces.copy()])

    def save(self):
        pass

    def close(self):
        pass


@pytest.mark.parametrize(("precision", "kind"), [(32, np.float32), (64, np.float64)])
def test_writers_get_the_precision_of_the_run_and_measures_double(precision, kind):
    sheet, kinds, keeper = square(9), [], Keeper()

    def mean(built, frame):
        arrays = [frame.displacement, frame.velocity, frame.damage, *frame.point_data.values()]
        kinds.extend(array.dtype for array in arrays)
        return frame.displacement[:, 2].mean()

    result = Simulation(
        sheet,
        BondAssociated(NEO, horizon=2.015),
        Explicit(0.02, frames=3),
        loads=[Fixed(sheet.edges("all")), Pressure(20.0)],
        damage=CriticalStretch(3.0),
        measures=[Measure("mean", "m", mean)],
    ).run(device="cpu", precision=precision, writers=[keeper])
    assert set(kinds) == {np.dtype(np.float64)} and result.frame.displacement.dtype == np.float64
    assert all(f.displacement.dtype == kind and f.velocity.dtype == kind for f in keeper.frames)
    assert result.history[-1]["mean"] == keeper.frames[-1].displacement[:, 2].astype(np.float64).mean() != 0.0
    np.testing.assert_array_equal(result.frame.velocity, keeper.frames[-1].velocity)
    # Frames stay what they were while the run goes on.
    for frame, copies in zip(keeper.frames, keeper.copies, strict=True):
        for now, then in zip((frame.displacement, frame.velocity, frame.intact_faces), copies, strict=True):
            np.testing.assert_array_equal(now, then)
