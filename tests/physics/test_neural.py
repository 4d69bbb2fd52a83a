"""Nodal, neural and closed-form laws: one physics in several evaluations, zero-energy modes, wrong input."""

import dataclasses
import itertools

import numpy as np
import pytest
import warp as wp
from click.testing import CliRunner
from helpers import (
    GENT,
    NEO,
    array,
    exact_stress,
    internal_force,
    jittered,
    random_gradient,
    rough,
    sever,
    square,
    strain_energy,
    uniform,
)
from test_bond_associated import force_across

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    Neural,
    Newton,
    Nodal,
    Pressure,
    Simulation,
    networks,
)
from warp_pd.cli import build_scene, main
from warp_pd.networks import Network
from warp_pd.torch_backend.training import relative_errors, sampled_states, training_data

RANGE = (0.8, 4.0)


def build(sheet, law, precision=64, device="cpu", solver=None, **parts):
    built = Simulation(sheet, force=law, solver=solver or Explicit(1.0), **parts).build(device, precision)
    built.context.compile()
    return built


def tiny(seed=0, hidden=(5, 7), **changes):
    """A network with random weights, force-free at rest."""
    from warp_pd.torch_backend.training import at_rest

    rng = np.random.default_rng(seed)
    sizes = [4, *hidden, 2]
    values = {
        "weights": tuple(rng.normal(size=(b, a)) / a for a, b in itertools.pairwise(sizes)),
        "biases": tuple(0.3 * rng.normal(size=b) for b in sizes[1:]),
        "input_mean": np.array([0.1, 0.02, 0.3, 0.0]),
        "input_scale": np.array([0.5, 0.2, 1.1, 1.0]),
        "output_scale": np.array([1.5, 0.7]),
        "material": "NeoHookean",
        "ratios": {"bulk/mu": 100.0},
        "stretches": RANGE,
    }
    return at_rest(Network(**(values | changes)))


def exact_module():
    """The closed form of the neo-Hookean law as a user's own module, from the formula of the paper's quantities."""
    import torch

    class Exact(torch.nn.Module):
        def forward(self, features):
            stretch, angle, c33, det = features.unbind(1)
            a, b = stretch * angle.cos(), stretch * angle.sin()
            g = (c33 * det**2) ** (-1.0 / 3.0)
            along, across = g * (a - c33 * (1.0 + b * b / det) / a), g * b * (1.0 + c33 / det)
            return torch.stack(
                [along * angle.cos() + across * angle.sin(), across * angle.cos() - along * angle.sin()], 1
            )

    return Exact()


LAWS = {
    "nodal": lambda: Nodal(NEO),
    "closed form": lambda: Neural(NEO, evaluation="closed_form"),
    "closed form, Gent": lambda: Neural(GENT, evaluation="closed_form"),
    "neural": lambda: Neural(NEO),
    "neural, tiny": lambda: Neural(NEO, network=tiny()),
    "neural, fused": lambda: Neural(NEO, evaluation="fused", network=tiny()),
}


# One map in several evaluations ---------------------------------------------------------------------------


@pytest.mark.parametrize("material", [NEO, GENT], ids=["neo-Hookean", "Gent"])
def test_the_closed_form_is_the_law_of_the_training_data(material):
    """Bulk stress of uniform deformation: exactly that of the material, in any frame."""
    sheet = square(27)
    for seed in range(3):
        F = random_gradient(seed)
        stress = exact_stress(material, F) * sheet.thickness
        for law in (Nodal(material), Neural(material, evaluation="closed_form")):
            built = build(sheet, law)
            internal_force(built, uniform(sheet, F))
            scale = np.abs(stress).max()
            assert np.abs(force_across(built, horizontal=False) - stress[:, 0]).max() < 1e-11 * scale
            assert np.abs(force_across(built, horizontal=True) - stress[:, 1]).max() < 1e-11 * scale


@pytest.mark.parametrize("material", [NEO, GENT], ids=["neo-Hookean", "Gent"])
def test_training_data_are_first_piola_stress_on_the_bond(material):
    states = sampled_states(RANGE, 40, seed=1)
    data = training_data(material, states)
    for (first, second, angle), features, force in zip(states, data.features, data.forces, strict=True):
        U = np.diag([first, second])
        x = np.array([np.cos(angle), np.sin(angle)])
        y = U @ x
        T = exact_stress(material, U) @ x / material.mu
        along = y / np.linalg.norm(y)
        assert force == pytest.approx([T @ along, T @ [-along[1], along[0]]], abs=1e-10)
        turn = np.arcsin((x[0] * y[1] - x[1] * y[0]) / np.linalg.norm(y))
        assert features[[0, 1, 3]] == pytest.approx([np.linalg.norm(y), turn, first * second], abs=1e-13)


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("sheet", [square(11), jittered(11)], ids=["lattice", "cloud"])
def test_a_users_module_with_the_closed_form_gives_the_closed_form(sheet, precision):
    u = rough(sheet)
    exact = internal_force(build(sheet, Neural(NEO, evaluation="closed_form"), precision), u)
    hooked = internal_force(build(sheet, Neural(NEO, network=exact_module()), precision), u)
    assert np.abs(exact - hooked).max() < (1e-13 if precision == 64 else 3e-6) * np.abs(exact).max()


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("breakable", [False, True])
@pytest.mark.parametrize("sheet", [square(11), jittered(11)], ids=["lattice", "cloud"])
def test_fused_and_torch_agree(sheet, precision, breakable):
    forces = []
    for evaluation in ("torch", "fused"):
        law = Neural(NEO, evaluation=evaluation, network=tiny())
        built = build(sheet, law, precision, damage=CriticalStretch(9.0) if breakable else None)
        if breakable:
            sever(built, ((0.02, 0.048), (0.07, 0.062)))
        forces.append(internal_force(built, rough(sheet)))
    assert np.isfinite(forces[0]).all()
    difference = np.abs(forces[0] - forces[1]).max()
    assert difference < (1e-12 if precision == 64 else 2e-5) * np.abs(forces[0]).max()


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("hidden", [(5, 7), (6,), (4, 4, 3), (32, 32)], ids=str)
def test_networks_of_any_shape_run_fused(hidden, precision):
    sheet = square(9)
    forces = []
    for evaluation in ("torch", "fused"):
        built = build(sheet, Neural(NEO, evaluation=evaluation, network=tiny(hidden=hidden)), precision)
        forces.append(internal_force(built, rough(sheet)))
    assert np.abs(forces[0]).max() > 0.0
    difference = np.abs(forces[0] - forces[1]).max()
    assert difference < (1e-12 if precision == 64 else 2e-5) * np.abs(forces[0]).max()


def test_torch_evaluates_what_numpy_does():
    sheet = square(9)
    network = tiny()
    built = build(sheet, Neural(NEO, network=network))
    internal_force(built, rough(sheet))
    features, pairs = array(built, "features").numpy(), array(built, "bond_pairs").numpy()
    assert pairs == pytest.approx(network.evaluate(features), abs=1e-12)
    assert np.ptp(features, axis=0).min() > 1e-3


# Physics ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("law", LAWS)
def test_rigid_motion_gives_no_force_and_momentum_is_conserved(law, precision):
    sheet = square(11)
    built = build(sheet, LAWS[law](), precision)
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    tolerance = 1e-12 if precision == 64 else 1e-4
    strained = np.abs(internal_force(built, uniform(sheet, 1.1 * rotation[:, :2]))).max()
    moved = uniform(sheet, rotation[:, :2]) + [0.3, -0.2, 0.5]
    assert np.abs(internal_force(built, moved)).max() < 10 * tolerance * strained
    force = internal_force(built, rough(sheet))
    assert np.abs(force.sum(axis=0)).max() < tolerance * np.abs(force).max()


@pytest.mark.parametrize("law", LAWS)
def test_forces_turn_with_the_sheet(law):
    sheet = square(11)
    built = build(sheet, LAWS[law]())
    rotation, _ = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))
    flat = np.column_stack([sheet.points, np.zeros(sheet.size)])
    displacement = rough(sheet)
    turned = (flat + displacement) @ rotation.T - flat
    force = internal_force(built, displacement)
    assert internal_force(built, turned) == pytest.approx(force @ rotation.T, abs=1e-10 * np.abs(force).max())


def broken(sheet, law):
    built = build(sheet, law, damage=CriticalStretch(9.0))
    sever(built, ((0.02, 0.048), (0.07, 0.062)))
    alive = built.law.intact.numpy()
    rng = np.random.default_rng(2)
    keep = built.law.families.rows_of_points(built.law.families.exists)
    for i in (30, 31, 44):
        for k in np.flatnonzero(((rng.random(keep.shape[1]) < 0.8) | (i == 44)) & keep[i]):
            j, back = i + built.law.families.shift[k], built.law.families.reverse[k]
            alive[k // 32, i] &= ~np.uint32(1 << (k % 32))
            alive[back // 32, j] &= ~np.uint32(1 << (back % 32))
    built.law.intact.assign(alive)
    return built


NODAL = {
    "lattice": lambda: build(square(9), Nodal(NEO)),
    "Gent, short horizon": lambda: build(square(9), Nodal(GENT, horizon=1.5)),
    "cloud": lambda: build(jittered(9), Nodal(NEO)),
    "cut": lambda: build(square(9).cut((-0.01, 0.045), (0.045, 0.045)), Nodal(NEO)),
    "broken": lambda: broken(square(11), Nodal(NEO)),
}


@pytest.mark.parametrize("case", NODAL)
def test_the_nodal_force_is_minus_the_gradient_of_its_energy(case):
    built = NODAL[case]()
    sheet = built.simulation.sheet
    displacement = rough(sheet)
    force = internal_force(built, displacement)
    rng = np.random.default_rng(3)
    for _ in range(3):
        direction = rng.normal(size=(sheet.size, 3)) * sheet.spacing
        up, down = (strain_energy(built, displacement + s * 1e-5 * direction) for s in (1.0, -1.0))
        assert (up - down) / 2e-5 == pytest.approx(
            -(force * direction).sum(), abs=2e-7 * np.abs(force * direction).sum()
        )


@pytest.mark.parametrize("law", LAWS)
def test_broken_families_stay_finite_and_conserve_momentum(law):
    built = broken(square(11), LAWS[law]())
    force = internal_force(built, rough(built.simulation.sheet))
    assert np.isfinite(force).all()
    assert np.abs(force[44]).max() == 0.0
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).max()


def test_a_bond_turned_over_is_pushed_back():
    """Past the pole of the closed form at 90 degrees the force stays finite, and works against the turn."""
    sheet = square(15)
    built = build(sheet, Neural(NEO, evaluation="closed_form"))
    middle = sheet.nearest(0.05, 0.05)
    largest = []
    for share in (0.9, 1.0, 1.1, 1.5):
        u = np.zeros((sheet.size, 3))
        u[middle, 0] = share * sheet.spacing
        force = internal_force(built, u)
        assert force[middle, 0] < 0.0
        largest.append(np.abs(force).max())
    assert np.isfinite(largest).all() and max(largest) < 1e3 * NEO.mu * sheet.thickness * sheet.spacing


# Zero-energy modes -------------------------------------------------------------------------------------------

RESISTING = {
    "closed form": lambda horizon: Neural(NEO, horizon=horizon, evaluation="closed_form"),
    "neural": lambda horizon: Neural(NEO, horizon=horizon),
    "bond-associated": lambda horizon: BondAssociated(NEO, horizon=horizon, weights="plain"),
}


def checkerboard(sheet, direction):
    """A checkerboard in the middle of a sheet, with margins of uniform deformation, [m]."""
    column, row = np.arange(sheet.size) % sheet.lattice.columns, np.arange(sheet.size) // sheet.lattice.columns
    board = np.zeros((sheet.size, 3))
    board[:, direction] = 0.02 * sheet.spacing * (-1.0) ** (column + row)
    return board


def resistance(law, sheet, mode, rows):
    """Work of the force against a mode, at the points `rows`, over E h times its squared size."""
    built = build(sheet, law)
    stretched = uniform(sheet, [[1.2, 0.0], [0.0, 1.2], [0.0, 0.0]])
    change = internal_force(built, stretched + mode) - internal_force(built, stretched)
    return -(change * mode)[rows].sum() / (3e3 * sheet.thickness * (mode[rows] ** 2).sum())


@pytest.mark.parametrize("direction", [0, 1, 2])
@pytest.mark.parametrize("horizon", [1.5, 2.015, 3.15])
def test_a_checkerboard_is_felt_by_all_laws_but_the_nodal_one(horizon, direction):
    sheet = square(21)
    inside = np.flatnonzero(np.abs(sheet.points - 0.05).max(axis=1) < 0.01)
    board = checkerboard(sheet, direction)
    assert abs(resistance(Nodal(NEO, horizon=horizon), sheet, board, inside)) < 1e-12
    for name, law in RESISTING.items():
        assert resistance(law(horizon), sheet, board, inside) > 0.1 / horizon**2, name


@pytest.mark.parametrize("direction", [0, 1, 2])
def test_a_family_does_not_feel_its_own_middle_only_in_the_nodal_law(direction):
    """The centre-point mode: what the family of a moved point does, not what its neighbours' families do."""
    sheet = square(21)
    middle = sheet.nearest(0.05, 0.05)
    stretched = uniform(sheet, [[1.2, 0.0], [0.0, 1.2], [0.0, 0.0]])
    moved = stretched.copy()
    moved[middle, direction] += 0.2 * sheet.spacing
    changes = {}
    for name, law in {"nodal": lambda horizon: Nodal(NEO, horizon=horizon), **RESISTING}.items():
        built = build(sheet, law(3.15))
        internal_force(built, stretched)
        before = built.to_numpy(array(built, "bond_force"))[:, middle]
        internal_force(built, moved)
        after = built.to_numpy(array(built, "bond_force"))[:, middle]
        changes[name] = (after - before).sum(axis=0)[direction] / np.linalg.norm(before, axis=1).max()
    assert abs(changes.pop("nodal")) < 1e-12
    # The sum of the family's pull on the moved point is against its move.
    assert all(change < -1e-2 for change in changes.values()), changes


# The network's file and the user's own modules ----------------------------------------------------------------


def test_the_default_network_is_as_good_as_promised():
    """R^2 >= 0.9999 and at most 1 % relative error (of the force, or 0.1 mu) on states training never saw."""
    from warp_pd.torch_backend.training import determination

    network = networks.default()
    data = training_data(NEO, sampled_states(RANGE, 20_000, seed=99))
    found = network.evaluate(data.features)
    assert min(determination(found, data.forces)) >= 0.9999
    assert relative_errors(found, data.forces).max() <= 0.01
    assert network.evaluate(np.array([[1.0, 0.0, 1.0, 1.0]])) == pytest.approx(np.zeros((1, 2)), abs=1e-14)


def test_training_finds_the_law_and_repeats_itself(tmp_path):
    from warp_pd.torch_backend.training import Training, train

    seen = []
    how = Training(samples=400, hidden=(6,), steps=25, seed=3, stretches=(0.9, 2.0))
    network, parts = train(NEO, how, lambda *now: seen.append(now))
    assert [len(parts[name].states) for name in ("training", "validation", "test")] == [280, 60, 60]
    assert network.report["largest_relative_error"] < 0.1
    assert seen[-1][2] < 0.1 * seen[0][2]
    again, _ = train(NEO, how)
    assert all((a == b).all() for a, b in zip(network.weights, again.weights, strict=True))
    network.save(tmp_path / "mine.npz")
    assert not list(tmp_path.glob("*.part"))
    loaded = networks.load(tmp_path / "mine.npz")
    features = parts["test"].features
    assert (loaded.evaluate(features) == network.evaluate(features)).all()
    assert (loaded.stretches, loaded.ratios) == ((0.9, 2.0), {"bulk/mu": 100.0})
    assert Neural(NEO, network=tmp_path / "mine.npz").loaded is not None


def saved(path, edit=None, **changes):
    network = tiny(**changes)
    network.save(path)
    if edit is not None:
        with np.load(path) as stored:
            arrays = dict(stored)
        edit(arrays)
        np.savez(path, **arrays)
    return path


def of_version(version):
    import json

    def edit(arrays):
        facts = json.loads(bytes(arrays["facts"])) | {"version": version}
        arrays["facts"] = np.frombuffer(json.dumps(facts).encode(), np.uint8)

    return edit


def with_nan(arrays):
    arrays["weights_1"][2, 1] = np.nan


def with_wrong_width(arrays):
    arrays["weights_0"] = arrays["weights_0"][:, :3]


BAD_FILES = {
    "other version": (of_version(7), "version 7, allowed is 1"),
    "NaN weight": (with_nan, "layer 1 has a weight that is not finite"),
    "wrong width": (with_wrong_width, "layer 0 has weights of shape (5, 3), allowed are 4 inputs"),
    "lost layer": (lambda arrays: arrays.pop("biases_1"), "damaged"),
    "no facts": (lambda arrays: arrays.pop("facts"), "damaged"),
    "three outputs": (
        lambda arrays: arrays.update(weights_2=np.zeros((3, 7)), biases_2=np.zeros(3)), "3 outputs, allowed are 2"
    ),
    "zero scale": (lambda arrays: arrays.update(input_scale=np.zeros(4)), "input_scale"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_model_files_end_with_one_line(case, tmp_path):
    edit, said = BAD_FILES[case]
    path = saved(tmp_path / "bad.npz", edit)
    with pytest.raises(InputError, match=r"allowed|damaged") as refused:
        Neural(NEO, network=path)
    assert said in str(refused.value) and "bad.npz" in str(refused.value) and "\n" not in str(refused.value)


def test_missing_and_foreign_files_and_materials_are_refused(tmp_path):
    (tmp_path / "text.npz").write_text("no network")
    cases = [
        (lambda: Neural(NEO, network=tmp_path / "none.npz"), "does not exist"),
        (lambda: Neural(NEO, network=tmp_path / "text.npz"), "damaged"),
        (lambda: Neural(GENT), "allowed with network 'the default' is NeoHookean(bulk/mu = 100)"),
        (lambda: Neural(dataclasses.replace(NEO, bulk=2e5)), "NeoHookean(bulk/mu = 200): allowed"),
        (lambda: Neural(NEO, network=tiny(ratios={"bulk/mu": 50.0})), "bulk/mu = 50"),
        (lambda: Neural(NEO, network=3), "network = 3"),
        (lambda: Neural(NEO, evaluation="exact"), "'exact'"),
        (lambda: Neural(NEO, evaluation="fused", network=tiny(hidden=(100, 100))), "at most"),
        (lambda: Neural(NEO, evaluation="fused", network=lambda x: x), "fused"),
        (lambda: Neural(NEO, evaluation="closed_form", network=tiny()), "closed_form"),
        (lambda: Neural(NEO, horizon=-1.0), "horizon = -1.0"),
    ]
    for make, said in cases:
        with pytest.raises(InputError, match=r"allowed|damaged") as refused:
            make()
        assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_material_scaled_in_mu_may_use_the_same_network():
    stiff = dataclasses.replace(NEO, mu=5.0 * NEO.mu, bulk=5.0 * NEO.bulk)
    sheet = square(9)
    soft = internal_force(build(sheet, Neural(NEO, network=tiny())), rough(sheet))
    hard = internal_force(build(sheet, Neural(stiff, network=tiny())), rough(sheet))
    assert hard == pytest.approx(5.0 * soft, abs=1e-12 * np.abs(hard).max())


def test_modules_that_do_not_fit_are_refused():
    import torch

    broken_one = torch.nn.Linear(4, 2)
    with torch.no_grad():
        broken_one.weight[0, 0] = float("nan")
    cases = [
        (torch.nn.Linear(3, 2), "refused (2, 4)"),
        (torch.nn.Linear(4, 3), "gave (2, 3)"),
        (lambda features: None, "gave NoneType"),
        (broken_one, "not finite"),
    ]
    for module, said in cases:
        with pytest.raises(InputError, match="allowed") as refused:
            build(square(5), Neural(NEO, network=module))
        assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_plain_function_serves_as_the_network_and_its_module_is_left_alone():
    import torch

    sheet = square(9)
    module = exact_module()
    module.unused = torch.nn.Parameter(torch.ones(1, dtype=torch.float32))
    from_module = internal_force(build(sheet, Neural(NEO, network=module)), rough(sheet))
    from_function = internal_force(build(sheet, Neural(NEO, network=exact_module().forward)), rough(sheet))
    assert (from_module == from_function).all()
    assert module.unused.dtype == torch.float32


def test_thousand_steps_record_no_gradients_and_hold_no_memory():
    import gc
    import resource

    import torch

    module = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.Tanh(), torch.nn.Linear(8, 2))
    built = build(square(13), Neural(NEO, network=module))
    sequence = built.context.sequence("step", repeat=10)
    step = built.law._infer
    assert any(p.requires_grad for p in step.function.parameters())

    def tensors():
        gc.collect()
        return sum(isinstance(o, torch.Tensor) for o in gc.get_objects())

    for _ in range(10):
        sequence.run()
    before, peak = tensors(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(100):
        sequence.run()
    assert tensors() == before
    # The graph of one step alone would hold 4 * 10^4 numbers; a thousand of them 0.3 GB.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 20_000
    assert not step.pairs.requires_grad and step.pairs.grad_fn is None
    assert step.pairs.data_ptr() == array(built, "bond_pairs").ptr


# Runs ---------------------------------------------------------------------------------------------------------


def stretched_run(law, gradient, **parts):
    sheet = square(9)
    u = uniform(sheet, gradient)
    solver = Explicit(duration=1e-4, frames=2)
    return Simulation(
        sheet, force=law, solver=solver, loads=[Fixed(sheet.edges("all"))], initial_displacement=u, **parts
    ).run(device="cpu")


def test_bonds_outside_the_training_range_are_counted_and_told():
    inside = stretched_run(Neural(NEO), [[2.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    assert inside.history[0]["bonds_outside_training"] == 0.0
    assert not [n for n in inside.summary["notes"] if "training range" in n]
    beyond = stretched_run(Neural(NEO), [[0.75, 0.0], [0.0, 1.0], [0.0, 0.0]])
    assert beyond.history[0]["bonds_outside_training"] == beyond.summary["bonds"]
    told = [n for n in beyond.summary["notes"] if "training range" in n]
    assert len(told) == 1 and f"{beyond.summary['bonds']} of {beyond.summary['bonds']} bonds" in told[0]
    for law in (Neural(NEO, evaluation="closed_form"), Neural(NEO, network=exact_module()), Nodal(NEO)):
        assert "bonds_outside_training" not in stretched_run(law, np.eye(3)[:, :2]).history[0]


def test_a_law_without_an_energy_invents_none(tmp_path):
    sheet = square(9)
    for law, known in ((Neural(NEO, evaluation="closed_form"), False), (Nodal(NEO), True)):
        simulation = Simulation(
            sheet,
            force=law,
            solver=Explicit(duration=0.02, frames=4, damping=1.0),
            loads=[Fixed(sheet.edges("all")), Pressure(5.0)],
            damage=CriticalStretch(1.2),
            initial_displacement=uniform(sheet, [[1.1, 0.0], [0.0, 1.0], [0.0, 0.0]]) + rough(sheet, 0.1) * 0.3,
        )
        result = simulation.run(device="cpu", out=tmp_path, usd=False)
        row, energy = result.history[-1], result.summary["energy"]
        assert result.status == "finished"
        assert row["largest_damage"] > 0.0
        assert ("strain" in row) is ("rupture" in row) is ("balance_error" in row) is known
        assert (energy["strain"] is not None) is (energy["balance_error"] is not None) is known
        assert row["kinetic"] > 0.0 and row["external"] != 0.0 and row["damping"] > 0.0
        assert any("no potential" in n for n in result.summary["notes"]) is not known
        if known:
            assert abs(row["balance_error"]) < 0.05


def test_restart_goes_on_bit_for_bit_and_refuses_other_weights(tmp_path):
    def simulation(seed):
        sheet = square(9)
        solver = Explicit(duration=0.02, frames=4)
        loads = [Fixed(sheet.edges("all")), Pressure(5.0)]
        return Simulation(sheet, force=Neural(NEO, network=tiny(seed)), solver=solver, loads=loads)

    whole = simulation(0).run(device="cpu", precision=64)
    cut = simulation(0)

    class Stop:
        def write(self, frame):
            recorder_stops = frame.index == 2
            if recorder_stops:
                raise KeyboardInterrupt

        def save(self):
            pass

        def close(self):
            pass

    cut.run(device="cpu", precision=64, out=tmp_path, usd=False, writers=[Stop()])
    with pytest.raises(InputError, match="other settings"):
        simulation(1).run(device="cpu", precision=64, out=tmp_path, usd=False, resume=True)
    resumed = simulation(0).run(device="cpu", precision=64, out=tmp_path, usd=False, resume=True)
    assert (resumed.frame.displacement == whole.frame.displacement).all()


def test_newton_asks_for_a_tangent():
    sheet = square(9)
    for law in (Nodal(NEO), Neural(NEO, evaluation="closed_form")):
        with pytest.raises(InputError, match="allowed with the solver Newton are BondAssociated"):
            Simulation(sheet, force=law, solver=Newton()).build(device="cpu")


SCENES = {
    # The nodal law finds no rest under a follower pressure: its corners crumple without resistance.
    "pressure_static": {"force": "closed_form", "points": 9, "tolerance": 1e-2},
    "pressure_dynamic": {"force": "nodal", "points": 9, "duration": 0.02, "frames": 2},
    "out_of_plane": {"force": "neural_fused", "points": 15, "duration": 0.02, "frames": 2},
    "precut_tear": {"force": "nodal", "points": 15, "duration": 0.02, "frames": 2},
    "ball_penetration": {"force": "neural", "points": 9, "duration": 0.02, "frames": 2},
}


@pytest.mark.parametrize("name", SCENES)
def test_scenes_take_any_law(name):
    result = build_scene(name, SCENES[name] | {"horizon": 2.015}).run(device="cpu")
    assert result.status == "finished"
    assert np.abs(result.frame.displacement).max() > 0.0
    said = [n for n in result.summary["notes"] if n.startswith("solver: Relaxation")]
    assert len(said) == (name == "pressure_static")


def test_the_command_line_takes_the_law(tmp_path):
    small = ["run", "pressure_static", "--points", "9", "--device", "cpu", "--set", "tolerance=1e-2", "--no-usd"]
    done = CliRunner().invoke(main, [*small, "--force", "neural", "--out", str(tmp_path / "a"), "--no-pictures"])
    assert done.exit_code == 0, done.output
    assert "no potential" in done.output and "solver: Relaxation, as neural has no tangent" in done.output
    for wrong, said in (
        (["--force", "neurla"], "did you mean 'neural'"),
        (["--force", "none.npz"], "does not exist"),
        (["--force", "nodal", "--weights", "plain"], "weights = 'plain'"),
        (["--force", "nodal", "--solver", "newton"], "Newton"),
    ):
        done = CliRunner().invoke(main, [*small, *wrong, "--out", str(tmp_path / "b")])
        assert done.exit_code == 2 and said in done.output and "Traceback" not in done.output
        assert len(done.output.strip().splitlines()) == 1


def test_the_network_in_a_graph_on_cuda():
    """Torch's part is captured with Warp's: ten steps in one replay give what ten single ones do, and the CPU."""
    wp.init()
    if not wp.is_cuda_available():
        pytest.skip("no CUDA device")
    sheet = square(13)
    parts = {"loads": [Fixed(sheet.edges("all"))], "initial_displacement": rough(sheet, size=0.02)}
    for evaluation in ("torch", "fused"):
        for precision in (32, 64):
            law = Neural(NEO, evaluation=evaluation, network=tiny())
            ended = []
            for device, repeat in (("cpu", 1), ("cuda:0", 1), ("cuda:0", 10)):
                built = build(sheet, law, precision, device, **parts)
                built.state.step.assign(np.array([1e-5], built.state.step.numpy().dtype))
                sequence = built.context.sequence("step", repeat=repeat)
                for _ in range(20 // repeat):
                    sequence.run()
                ended.append(built.to_numpy(built.state.velocity))
            assert (ended[1] == ended[2]).all()
            scale = np.abs(ended[0]).max()
            assert np.abs(ended[0] - ended[1]).max() < (1e-10 if precision == 64 else 1e-3) * scale
