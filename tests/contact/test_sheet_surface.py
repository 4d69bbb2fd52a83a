"""Contact of triangles of sheets with each other: nothing passes, and momentum, energy, friction, cracks and bits."""

import itertools

import numpy as np
import pytest
from helpers import Kept, square
from passing import crossing
from resumed_runs import require_same_when_stopped
from scipy.spatial import cKDTree
from small_runs import simulate

from warp_pd import (
    BodyForce,
    Explicit,
    InputError,
    Motion,
    NeoHookean,
    Place,
    SelfContact,
    Sheet,
    placed,
    together,
)
from warp_pd.contact import sheet_surface
from warp_pd.geometry.triangulation import directed_edges, undirected

# Speed of waves in the sheets of `square` [m/s], and their stable step [s].
WAVES, STABLE = 2.0, 6.4e-3
CONTACT = SelfContact(surface=True, friction=0.3)


def collision(speed, sideways=0.0, steps=32, step=0.4 * STABLE, per_frame=1, corner=(0.017, 0.012), rough=0.0):
    """A square that falls on a larger one, from places that differ by up to `rough`; both are free."""
    sheet = together(square(11), square(7, 0.058))
    start = placed(sheet, Place(), Place((*corner, 0.0), degrees=20.0))
    start += rough * np.random.default_rng(1).uniform(-1.0, 1.0, start.shape)
    upper = sheet.pieces == 2
    start[upper, 2] += 1.2 * sheet.spacing
    velocity = np.zeros((sheet.size, 3))
    velocity[upper] = (sideways, 0.0, -speed)
    return simulate(
        sheet, Explicit(steps * step, frames=steps // per_frame, step=step), contact=CONTACT,
        initial_displacement=start, initial_velocity=velocity,
    )  # fmt: skip


def followed(simulation):
    """The result, and places and velocities of every frame, (frames, N, 3)."""
    steps = Kept(lambda frame: (simulation.sheet.positions + frame.displacement, frame.velocity))
    result = simulation.run(device="cpu", precision=64, writers=[steps])
    return result, *np.array(steps.all).swapaxes(0, 1)


def momenta(result, velocities, points=slice(None)):
    mass = result.built.to_numpy(result.built.state.mass)[points, None]
    return (mass * velocities[:, points]).sum(axis=1)


def require_same_momenta(result, places, velocities):
    """Momentum and angular momentum, also with friction."""
    found = momenta(result, velocities)
    assert np.abs(found - found[0]).max() < 1e-14 * np.abs(found[0]).max()
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    turning = (mass * np.cross(places, velocities)).sum(axis=1)
    assert np.abs(turning - turning[0]).max() < 1e-14 * np.abs(found[0]).max()


@pytest.mark.parametrize("speed", [3.0, 0.2])
def test_no_side_crosses_a_triangle_and_no_energy_or_momentum_appears(speed):
    simulation = collision(speed * WAVES, sideways=0.05 * WAVES, steps=24)
    result, places, velocities = followed(simulation)
    triangles = simulation.sheet.triangles
    assert [pair for place in places for pair in crossing(place, triangles)] == []
    require_same_momenta(result, places, velocities)
    first, rows = result.history[0], result.history
    lost = np.array([row["contact"] + row["sheet_friction"] for row in rows])
    assert lost[-1] > 0.05 * first["kinetic"]
    assert np.diff(lost).min() > -1e-3 * first["kinetic"]
    assert np.diff([row["sheet_friction"] for row in rows]).min() > -1e-12 * first["kinetic"]
    assert max(abs(row["balance_error"]) for row in rows) < 5e-3
    assert result.summary["stable_dt"] == pytest.approx(STABLE, rel=0.02)


def test_ipctk_finds_no_collision_in_any_step():
    """The continuous collision detection of incremental potential contact, which has no code in common with ours."""
    ipctk = pytest.importorskip("ipctk")
    simulation = collision(3.0 * WAVES, sideways=0.05 * WAVES, steps=24)
    result, places, _ = followed(simulation)
    triangles = simulation.sheet.triangles
    mesh = ipctk.CollisionMesh(simulation.sheet.positions, ipctk.edges(triangles), triangles)
    # By default a fifth of each distance counts as zero; we keep a tenth.
    exact = {"narrow_phase_ccd": ipctk.TightInclusionCCD(conservative_rescaling=0.999)}
    assert result.history[-1]["contact"] > 0.0
    assert all(ipctk.is_step_collision_free(mesh, *pair, **exact) for pair in itertools.pairwise(places))
    upper = (simulation.sheet.pieces == 2)[:, None]
    through = np.where(upper, places[0] - (0.0, 0.0, 4.0 * simulation.sheet.spacing), places[0])
    assert not ipctk.is_step_collision_free(mesh, places[0], through, **exact)


def test_friction_is_that_of_coulomb():
    """While all of a sheet slides, by a tenth of a spacing in a step, the ratio of the impulses is the coefficient."""
    simulation = collision(0.5 * WAVES, sideways=0.2 * WAVES, steps=8)
    result, _, velocities = followed(simulation)
    given = np.diff(momenta(result, velocities, simulation.sheet.pieces == 2)[[0, -1]], axis=0)[0]
    assert given[2] > 0.0
    assert given[0] / given[2] == pytest.approx(-CONTACT.friction, rel=0.03)


def test_a_sheet_that_crosses_itself_at_the_start_is_refused():
    sheet = together(square(11), square(7, 0.058))
    start = placed(sheet, Place(), Place((0.017, 0.012, 0.0), (1.0, 1.0, 0.0), 30.0))
    simulation = simulate(sheet, Explicit(STABLE, frames=1), contact=CONTACT, initial_displacement=start)
    with pytest.raises(InputError, match=r"triangles [0-9]+ and [0-9]+ cross at the start: expected") as found:
        simulation.run(device="cpu", precision=64)
    one, other = (int(word) for word in str(found.value).split() if word.isdigit())
    pairs = crossing(sheet.positions + start, sheet.triangles)
    corners = set(sheet.triangles[one])
    edges = np.sort(directed_edges(sheet.triangles), axis=1)
    first = np.unique(undirected(edges), return_index=True)[1]
    assert any(face == other and set(edges[first[side]]) <= corners for side, face in pairs)


def test_the_test_of_crossing_sees_a_side_that_crosses():
    apart = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    through = np.array([[0.2, 0.2, -1.0], [0.2, 0.3, 1.0], [3.0, 3.0, 1.0]])
    triangles = np.array([[0, 1, 2], [3, 4, 5]])
    assert len(crossing(np.vstack([apart, through]), triangles)) == 2
    assert crossing(np.vstack([apart, through + [0.0, 0.0, 1.5]]), triangles) == []


def test_a_run_repeats_its_bits_and_resumes(tmp_path):
    case = {"speed": 0.5 * WAVES, "sideways": 0.4, "per_frame": 5, "steps": 15}
    whole = require_same_when_stopped(lambda: collision(**case), tmp_path, [2])
    assert whole.history[2]["sheet_friction"] > 0.0


def test_contact_does_not_enlarge_round_off():
    """Even if points meet sides exactly, where a weight is zero in one run and 1e-14 in the other."""
    one, other = (
        collision(0.5 * WAVES, 0.4, steps=16, per_frame=16, corner=(0.02, 0.01), rough=rough).run(
            device="cpu", precision=64
        )
        for rough in (0.0, 1e-14)
    )
    assert one.history[-1]["sheet_friction"] > 0.0
    assert np.abs(one.frame.displacement - other.frame.displacement).max() < 1e-12


def test_the_fail_safe_alone_lets_nothing_pass(monkeypatch):
    """Without iterations that find impulses, points stay before they meet, and keep their momentum."""
    monkeypatch.setattr(sheet_surface, "ITERATIONS", 0)
    simulation = collision(0.5 * WAVES, steps=16)
    result, places, velocities = followed(simulation)
    assert [pair for place in places for pair in crossing(place, simulation.sheet.triangles)] == []
    require_same_momenta(result, places, velocities)


def test_crack_faces_touch():
    """Faces that lie on each other are pressed together: they stay within 0.1 % of a spacing."""
    spacing, line = 0.01, 0.05
    square_ = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
    sheet = Sheet.outline(
        square_, cracks=[[(0.0, line), (0.0655, line)]], spacing=spacing, thickness=1e-3, density=1000.0
    )
    pairs = cKDTree(sheet.points).query_pairs(1e-9, output_type="ndarray")
    assert len(pairs) > 5
    above = sheet.points[:, 1] > line + 1e-9
    for i in pairs.ravel():
        above[i] = sheet.points[sheet.triangles[(sheet.triangles == i).any(axis=1)], 1].mean() > line
    velocity = np.zeros((sheet.size, 3))
    velocity[:, 1] = np.where(above, -0.4, 0.4) * np.clip(1.0 - sheet.points[:, 0] / 0.06, 0.0, 1.0)
    lower, upper = pairs.T
    lower, upper = np.where(above[lower], upper, lower), np.where(above[lower], lower, upper)
    opening = {}
    for contact in (CONTACT, None):
        solver = Explicit(0.01, frames=20)
        result, places, _ = followed(simulate(sheet, solver, contact=contact, initial_velocity=velocity))
        opening[contact] = (places[:, upper, 1] - places[:, lower, 1]).min() / spacing
        assert max(abs(row["balance_error"]) for row in result.history) < 1e-3
    assert opening[CONTACT] > -1e-3
    assert opening[None] < -0.5


@pytest.mark.parametrize(("friction", "damping", "load"), [(0.0, 40.0, 40.0), (0.3, 40.0, 0.0), (0.3, 0.0, 40.0)])
def test_the_balance_of_energy_has_the_work_of_loads_damping_and_supports_to_round_off(friction, damping, load):
    """Sheets without stiffness leave no error of the strain energy: all that is lost, and all work, is of contact.

    A sheet is pulled, damped and thrown on another one, of which one half moves upwards on a support and the other,
    held along x alone, gets what the impacts give.
    """
    sheet = together(square(9), square(6, 0.058))
    start = placed(sheet, Place(), Place((0.017, 0.012, 1.2 * sheet.spacing), degrees=20.0))
    velocity = np.zeros((sheet.size, 3))
    velocity[sheet.pieces == 2] = (0.1 * WAVES, 0.0, -0.5 * WAVES)
    lower, left = sheet.pieces == 1, sheet.points[:, 0] < 0.05
    velocity[lower & left] = (0.05 * WAVES, 0.0, 0.2 * WAVES)
    velocity[lower & ~left] = (0.05 * WAVES, 0.02 * WAVES, 0.1 * WAVES)
    speed, end = 0.05 * WAVES, 20 * 0.2 * STABLE
    loads = [
        Motion(np.flatnonzero(lower & left), [0.0, 1.0], x=[0.0, speed], y=0.0, z=[0.0, 0.2 * WAVES]),
        Motion(np.flatnonzero(lower & ~left), [0.0, 1.0], x=[0.0, speed]),
    ]
    if load:
        loads.append(BodyForce((300.0 * load, 200.0 * load, -1000.0 * load)))
    rows = simulate(
        sheet, Explicit(end, frames=20, step=0.2 * STABLE, damping=damping), material=NeoHookean(1e-9, 1e-7),
        contact=SelfContact(surface=True, friction=friction), initial_displacement=start, initial_velocity=velocity,
        loads=loads,
    ).run(device="cpu", precision=64).history  # fmt: skip
    lost = rows[-1]["contact"] + rows[-1].get("sheet_friction", 0.0)
    assert lost > 0.05 * rows[0]["kinetic"] and abs(rows[-1]["external"]) > 0.01 * rows[0]["kinetic"]
    assert max(abs(row["balance_error"]) for row in rows) < 1e-12
