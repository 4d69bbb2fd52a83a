"""Partitions of a sheet among processes, and their families."""

from dataclasses import fields, replace

import numpy as np
import pytest
from helpers import refused
from shared_scenes import SIZE, composed, scene, sheet_of

from warp_pd import Sheet
from warp_pd.distributed.local_families import builds_alone, local_cloud_families, local_rows
from warp_pd.distributed.partition import partition_sheet, sheet_on_partition
from warp_pd.families import Families, build_families
from warp_pd.families.partition import ALIGNED
from warp_pd.kernels.block_sums import BLOCK
from warp_pd.kernels.stable_step import NOISE

NAMES = ("torn", "cloud", "scattered", "hole", "tube")


@pytest.mark.parametrize(("name", "points"), [*((name, 33) for name in NAMES), ("loads", ALIGNED + 7)])
@pytest.mark.parametrize("horizon", [1.5, 2.015, 3.15])
def test_every_point_has_one_owner_and_what_its_forces_need(name, points, horizon):
    sheet = sheet_of(name, points)
    families = build_families(sheet, horizon, "linear")
    owners, faces = np.zeros(sheet.size, int), np.zeros(len(sheet.triangles), int)
    for rank in range(3):
        partition = partition_sheet(sheet, horizon, rank, 3)
        here, near = np.zeros((2, sheet.size), bool)
        here[partition.points], near[partition.points[partition.near]] = True, True
        own = partition.points[partition.owned]
        owners[own] += 1
        faces[partition.faces] += 1
        assert partition.owners is not None or own[0] % BLOCK == 0
        # Of rows as long as that.
        assert points < ALIGNED or partition.owned.start % ALIGNED == partition.inner.start % ALIGNED == 0
        inner = families.members_of(partition.points[partition.inner])
        assert (
            np.isin(inner[inner >= 0], own).all()
            and partition.owned.start <= partition.inner.start <= partition.inner.stop
        )
        members = families.members_of(own)
        assert near[own].all() and near[members[members >= 0]].all() and near[sheet.triangles[partition.faces]].all()
        around = families.members_of(np.flatnonzero(near))
        assert here[around[around >= 0]].all()
    assert (owners == 1).all() and (faces == 1).all()


@pytest.mark.parametrize("name", NAMES)
def test_families_here_are_those_of_the_whole_sheet(name):
    sheet = sheet_of(name, 33)
    families = build_families(sheet, 2.015, "linear")
    partition = partition_sheet(sheet, 2.015, 1, 3)
    here = local_rows(families, partition).families
    local = np.flatnonzero(partition.near)
    members, whole = here.members_of(local), families.members_of(partition.points[local])
    assert ((members < 0) == (whole < 0)).all()
    assert (partition.points[members[members >= 0]] == whole[whole >= 0]).all()
    assert not here.exists[here.family_class if here.family_class is not None else slice(None)][~partition.near].any()
    assert here.bond_count == families.bond_count
    part = sheet_on_partition(sheet, partition)
    assert (partition.points[part.triangles] == sheet.triangles[partition.faces]).all()


@pytest.mark.parametrize("name", NAMES)
def test_layers_around_a_halo_are_those_of_the_triangles(name):
    sheet = sheet_of(name, 33)
    for rank in range(3):
        plain, wide = (partition_sheet(sheet, 2.015, rank, 3, layers) for layers in (0, 3))
        here, within = np.zeros(sheet.size, bool), np.zeros(sheet.size, bool)
        here[plain.points], within[wide.points] = True, True
        for _ in range(3):
            corners = sheet.triangles[here[sheet.triangles].any(axis=1)]
            here[corners] = True
        # Of a lattice they are whole rows.
        assert within[here].all() and (sheet.lattice is not None or not within[~here].any())
        assert within.sum() < sheet.size or rank == 1
        for one, other in ((plain.owned, wide.owned), (plain.near, wide.near), (plain.inner, wide.inner)):
            np.testing.assert_array_equal(plain.points[one], wide.points[other])


def test_more_processes_than_blocks_are_refused():
    sheet = Sheet.rectangle(1.0, 1.0, points=20, **SIZE)
    with refused(match=r"^processes = 8: expected at most 7 on a sheet of 400 points"):
        partition_sheet(sheet, 2.015, 0, 8)


def test_indices_of_points_here():
    made = scene("torn")
    partition = partition_sheet(made.sheet, 2.015, 1, 3)
    asked = np.array([0, partition.points[0], partition.points[5], made.sheet.size - 1])
    at, here = partition.here(asked)
    assert (partition.points[here] == asked[at]).all() and set(at) >= {1, 2}


@pytest.mark.parametrize("name", ["cloud", "scattered"])
def test_a_cloud_in_no_order_has_as_small_a_halo_as_one_in_order(name):
    """Two cuts of a square leave corners: 2 x 4.03 of 50 columns and rows, at most."""
    sheet = sheet_of(name, 100)
    for rank in range(4):
        partition = partition_sheet(sheet, 2.015, rank, 4)
        own = partition.owned.stop - partition.owned.start
        assert abs(own - sheet.size / 4) <= 1
        assert len(partition.points) / own < 1.17


def test_an_outline_is_divided_between_its_rows():
    sheet = Sheet.outline([(0, 0), (1, 0), (1, 1), (0.5, 1.2), (0, 1)], spacing=0.02, **SIZE)
    assert sheet.layout == "grid"
    on = np.flatnonzero(sheet.grid[:, 1] >= 0)
    for rank in range(3):
        partition = partition_sheet(sheet, 2.015, rank, 3)
        own = np.isin(on, partition.points[partition.owned])
        rows = sheet.grid[on, 1]
        assert not set(rows[own]) & set(rows[~own])
        assert len(partition.points) < 1.5 * sheet.size / 3


@pytest.mark.parametrize("name", ["cloud", "torn"])
def test_noise_of_some_points_is_that_of_all(name):
    """And it differs between estimates, is as large as stated, has no bias, and spares held components."""
    made = scene(name)
    alone, several = made.build(device="cpu"), [composed(made, rank, 2) for rank in range(2)]
    free = alone.context.held[:, None] & np.array([1, 2, 4]) == 0

    def drawn(built):
        step = built.solver.stable_step
        step.disturb()
        noise = step.direction.numpy().copy()
        step.direction.zero_()
        return noise

    before = np.zeros((made.sheet.size, 3))
    for _ in range(2):
        whole = drawn(alone)
        assert (whole != before)[free].all()
        assert not whole[~free].any()
        assert 0.99 * NOISE < np.abs(whole).max() <= NOISE
        assert abs(whole[free].mean()) < 5.0 * NOISE / np.sqrt(3.0 * free.sum())
        for built in several:
            np.testing.assert_array_equal(drawn(built), whole[built.context.partition.points])
            assert built.solver.stable_step.host_state() == alone.solver.stable_step.host_state()
        before = whole


@pytest.mark.parametrize("name", ["cloud", "scattered", "cut"])
@pytest.mark.parametrize("horizon", [1.5, 3.15])
def test_families_of_a_partition_of_a_cloud_are_those_of_the_whole(name, horizon):
    sheet = sheet_of("cloud" if name == "cut" else name, 33)
    if name == "cut":
        sheet = sheet.cut((0.2, 0.43), (0.8, 0.55)).stiffened(sheet.within((0.3, 0.3), 0.2), 3.0)
    whole = build_families(sheet, horizon, "linear")
    partitions = [partition_sheet(sheet, horizon, rank, 3) for rank in range(3)]
    for partition in partitions:
        assert builds_alone(sheet, partition)
        # What the others have: no lone point, as many members as any, and the bonds of their own points.
        own = [int(whole.exists[other.points[other.owned]].sum()) for other in partitions]
        others = iter([[sheet.size] * 3, [whole.members] * 3, own])
        found = local_cloud_families(
            sheet, partition, horizon, "linear", lambda number, others=others: [number, *next(others)]
        )
        assert found.bond_count == whole.bond_count + own[partition.rank]
        expected, near = local_rows(whole, partition).families, partition.near
        for field in fields(Families):
            one, other = getattr(found, field.name), getattr(expected, field.name)
            if isinstance(one, np.ndarray) and field.name != "reverses":
                assert one.dtype == other.dtype and one.shape == other.shape, field.name
                np.testing.assert_array_equal(one[near], other[near], err_msg=field.name)
        assert not found.exists[~near].any() and (found.neighbours[~near] == -1).all()
        # Bonds between two whole families: forces go along no others.
        there = found.exists & near[:, None]
        there[there] = near[found.neighbours[there]]
        np.testing.assert_array_equal(found.reverses[there], expected.reverses[there])
        for one, other in zip(found.inverse_shapes(), expected.inverse_shapes(), strict=True):
            np.testing.assert_array_equal(one[near], other[near])


def test_all_processes_refuse_the_same_lone_point():
    cloud = Sheet.filled(1.0, 1.0, points=33, jitter=0.2, **SIZE)
    far = np.array([[3.0, 0.5], [5.0, 0.5]])
    sheet = replace(cloud, points=np.vstack([cloud.points, far]), areas=np.append(cloud.areas, [1e-3, 1e-3]))
    lone = sheet.size - 2
    for rank in range(2):
        with refused(match=rf"points\[{lone}\] at \[3.0, 0.5\] has no neighbour"):
            local_cloud_families(
                sheet, partition_sheet(sheet, 2.015, rank, 2), 2.015, "linear", lambda number: [number, lone]
            )
