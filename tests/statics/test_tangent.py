"""The tangent of the bond-associated law: the derivative of the force, symmetric, and one operator in all its forms."""

from unittest.mock import patch

import numpy as np
import pytest
from curved_sheets import rough_motion, small_sphere, small_tube, tear
from helpers import GENT, NEO, jittered, rough, sever, soften, square
from material_kernels import evaluate, respond
from small_runs import simulate

from warp_pd import ByRegion, CriticalStretch, Explicit, Fixed, NeoHookean, Pressure, Sheet, TearingEnergy
from warp_pd.device.fields import assign
from warp_pd.statics import tangent
from warp_pd.statics.level import Level
from warp_pd.statics.tangent import tangent_of as newton_tangent


@pytest.mark.parametrize("material", [NEO, GENT, NeoHookean(1.0, 1.0), NeoHookean(1e3, 1e7)], ids=str)
def test_moduli_are_the_derivative_of_the_stress(material):
    rng = np.random.default_rng(0)
    F = np.array([[1.4, 0.1], [0.0, 1.1]]) + rng.uniform(-0.4, 0.4, (40, 2, 2))
    F = F[np.linalg.det(F) > 0.3]
    G = F.transpose(0, 2, 1) @ F - np.eye(2)
    stress, moduli = respond(material, G, 64)
    assert stress == pytest.approx(evaluate(material, G, 64)[0], rel=1e-12, abs=1e-12 * np.abs(stress).max())
    T = moduli[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    step = 1e-5
    for column, entries in enumerate([[(0, 0)], [(1, 1)], [(0, 1), (1, 0)]]):
        change = np.zeros((2, 2))
        for entry in entries:
            change[entry] = step
        slope = (evaluate(material, G + change, 64)[0] - evaluate(material, G - change, 64)[0]) / (2.0 * step)
        found = np.stack([slope[:, 0, 0], slope[:, 1, 1], 2.0 * slope[:, 0, 1]], axis=1)
        # The material's own iteration ends at 1e-13 of the volume: times K and over the step.
        allowed = 1e-7 * np.abs(T).max() + 1e-8 * material.bulk
        assert found == pytest.approx(T[:, :, column], abs=allowed)


def tangent_of(sheet, assembled, loads=(), damage=None, crack=None, **parts):
    """The level of Newton's method on a sheet with a crack, whatever Newton itself allows."""
    built = simulate(sheet, Explicit(1.0), loads=loads, damage=damage, **parts).build("cpu", 64)
    if crack is not None:
        tear(built) if sheet.frames is not None else sever(built, crack)
    if built.context.layout.softened:
        soften(built)
    context, state = built.context, built.state
    with patch.object(tangent, "stored_on", lambda device: assembled):
        level = Level(context, built.law, newton_tangent(built.law, context, True), built.external.following)
    names = {launch.name for launch in context.stages["linearise"]}
    assert ("assemble" in names) == assembled
    level.tangent.sparse()
    stage = context.stage("evaluate", "in this test")
    built.law.add_force(stage, state.displacement, state.force)
    if state.external is not None:
        built.external.add_force(stage, state.displacement, state.external)
    level.add_residual(stage, None)
    level.add_turning()
    return level


CLOUD = square(11).as_cloud()
HALVES = ByRegion(NEO, [(CLOUD.where(lambda x, y: x < 0.0501), GENT)])
GRADED = Sheet.outline(
    [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)], spacing=lambda x, y: 0.008 + 0.08 * x, thickness=1e-3, density=1e3
)
CRACK = ((0.02, 0.048), (0.07, 0.062))
CASES = {
    "lattice": (square(11), {"horizon": 3.15}),
    "assembled lattice": (square(11), {"assembled": True, "weights": "corrected"}),
    "assembled, 32 members and more": (square(15), {"assembled": True, "horizon": 4.15}),
    "lattice of varying thickness": (square(11, thickness=np.linspace(1e-3, 2e-3, 121)), {"assembled": True}),
    "Gent cloud": (jittered(11), {"material": GENT}),
    "broken lattice": (square(11), {"crack": CRACK, "damage": CriticalStretch(9.0)}),
    "sphere": (small_sphere(), {"weights": "corrected"}),
    "broken tube": (small_tube(16, 1.5), {"crack": CRACK, "damage": CriticalStretch(9.0)}),
    "two materials": (CLOUD, {"assembled": True, "material": HALVES, "weights": "corrected"}),
    "graded": (GRADED, {"assembled": True, "weights": "corrected"}),
    "softened and broken cloud": (jittered(11), {"crack": CRACK, "damage": TearingEnergy(10.0)}),
}  # fmt: skip


def left(sheet):
    """Points at the left side."""
    return sheet.edges("left") if sheet.frames is None else sheet.where(lambda x, y, z: x < x.min() + 0.1)


def moved(sheet):
    """A rough displacement."""
    return rough(sheet) if sheet.frames is None else rough_motion(sheet)


def product(level, displacement, direction):
    """The tangent at a displacement times a direction, which is the derivative of the residual along it."""
    assign(level.displacement, displacement)
    level.linearise(0.0)
    assign(level.vector, direction)
    level.run("product")
    found, ends = level.image.numpy().copy(), []
    for sign in (1.0, -1.0):
        assign(level.displacement, displacement + sign * 1e-6 * direction)
        level.evaluate()
        ends.append(level.residual.numpy().copy())
    expected = (ends[1] - ends[0]) / 2e-6
    assert np.abs(expected).max() > 0.0
    assert found == pytest.approx(expected, abs=2e-8 * np.abs(expected).max())
    return found


@pytest.mark.parametrize("case", CASES)
def test_the_tangent_is_the_derivative_of_the_force(case):
    sheet, parts = CASES[case]
    parts = {"assembled": False, **parts}
    held = left(sheet)
    level = tangent_of(sheet, loads=[Fixed(held)], **parts)
    displacement = moved(sheet)
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(3, sheet.size, 3)) * sheet.spacing
    for direction in directions[1:]:  # single points, their own blocks and those of their neighbours
        direction[rng.permutation(sheet.size)[3:]] = 0.0
    for direction in directions:
        product(level, displacement, direction)
    free = directions.copy()
    free[:, held] = 0.0
    # Symmetry, on the free components: a . K b = b . K a.
    assign(level.displacement, displacement)
    images = []
    for direction in free:
        assign(level.vector, direction)
        level.run("product")
        images.append(level.image.numpy().copy())
    scale = np.abs(free[0] * images[0]).sum()
    assert abs((free[0] * images[1]).sum() - (free[1] * images[0]).sum()) < 1e-12 * scale
    # The sparse matrix, and the diagonal blocks, are the same operator.
    assign(level.displacement, displacement)
    level.linearise(0.0)
    sparse = level.tangent.sparse()
    found = sparse.matrix() @ free[0].ravel()[sparse.free]
    assert found == pytest.approx(images[0].ravel()[sparse.free], abs=1e-11 * np.abs(images[0]).max())
    blocks = np.zeros((sheet.size, 3, 3))
    matrix = sparse.matrix().toarray()
    for order, point in enumerate(np.flatnonzero(sparse.free.reshape(-1, 3)[:, 0])):
        blocks[point] = matrix[3 * order : 3 * order + 3, 3 * order : 3 * order + 3]
    inverse = level.tangent.inverse_blocks.numpy()
    free_points = np.flatnonzero(sparse.free.reshape(-1, 3)[:, 0])
    spectra = np.linalg.eigvalsh(blocks[free_points])
    regular = free_points[spectra[:, 0] > 1e-5 * spectra[:, -1]]
    assert len(regular) > 0.8 * len(free_points)
    for point in regular:
        assert inverse[point] @ blocks[point] == pytest.approx(np.eye(3), abs=1e-6)


def test_a_rough_product_is_that_of_the_last_tangent_in_single_precision():
    sheet, parts = CASES["assembled lattice"]
    level = tangent_of(sheet, loads=[Fixed(left(sheet))], **parts)
    level.add_product(level.context.stage("rough product", "in this test"), level.vector, level.image, rough=True)
    assign(level.vector, np.random.default_rng(6).normal(size=(sheet.size, 3)))
    for share in (0.5, 1.0):
        assign(level.displacement, share * moved(sheet))
        level.linearise(0.0)
        images = []
        for stage in ("product", "rough product"):
            level.run(stage)
            images.append(level.image.numpy().copy())
        assert 1e-9 < np.abs(images[1] - images[0]).max() / np.abs(images[0]).max() < 1e-6


@pytest.mark.parametrize("case", CASES)
def test_a_family_turns_inside_out_at_the_longest_step(case):
    """There the normal of one intersection is at a right angle to what it was; a shorter step keeps all closer."""
    sheet, parts = CASES[case]
    level = tangent_of(sheet, loads=[Fixed(left(sheet))], **{"assembled": False, **parts})
    displacement, direction = moved(sheet), np.random.default_rng(5).normal(size=(sheet.size, 3)) * sheet.spacing
    assign(level.direction, direction)

    def normals(step):
        assign(level.displacement, displacement + step * direction)
        level.linearise(0.0)
        return np.cross(*np.moveaxis(level.tangent.gradient.numpy(), -1, 0))

    before = normals(0.0)
    there = (before * before).sum(axis=-1) > 0.0
    longest = level.longest_step()
    assert 0.0 < longest < 10.0

    def least(step):
        return ((before * normals(step)).sum(axis=-1)[there] / (before * before).sum(axis=-1)[there]).min()

    assert least(longest) == pytest.approx(0.0, abs=1e-9)
    assert least(0.5 * longest) > 0.1


FOLLOWER = {
    "lattice": (True, False),
    "Gent cloud": (True, False),
    "sphere": (True, True),
    "broken tube": (False, False),
    "softened and broken cloud": (False, False),
}


@pytest.mark.parametrize("case", FOLLOWER)
def test_follower_pressure_has_a_potential_on_an_untorn_sheet_whose_edges_are_held(case):
    sheet, parts = CASES[case]
    displacement = moved(sheet)
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, sheet.size, 3)) * sheet.spacing
    pressure = Pressure(500.0, on="triangles")
    held = Fixed([0] if case == "sphere" else sheet.edges())
    for loads, symmetric in zip(([held, pressure], [Fixed(left(sheet)), pressure]), FOLLOWER[case], strict=True):
        level = tangent_of(sheet, False, loads=loads, **{**parts, "weights": "corrected", "horizon": 2.015})
        free = ~level.held
        images = [product(level, displacement, direction) for direction in (a * free, b * free)]
        scale = np.linalg.norm(a * free) * np.linalg.norm(images[1])
        asymmetry = abs((a * free * images[1]).sum() - (b * free * images[0]).sum()) / scale
        assert asymmetry < 1e-12 if symmetric else asymmetry > 1e-6, asymmetry
