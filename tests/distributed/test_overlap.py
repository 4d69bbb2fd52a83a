"""The interior of a shared sheet runs while its halo is on the way, and sees nothing of it.

Streams are played on a CPU in the worst order: what is on the side stream runs only where the main one waits for it,
and halos hold no numbers until then.
"""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from shared_scenes import OneOfMany, scene

from warp_pd.device.fields import assign, to_host
from warp_pd.device.graph import run_once, side_stream_waits
from warp_pd.device.launches import Call, Launch, Span, Touched
from warp_pd.distributed import exchange
from warp_pd.distributed.overlap import overlap_exchanges
from warp_pd.kernels.effects import Effects
from warp_pd.run.built import compose
from warp_pd.tearing import damage_field
from warp_pd.tearing.damage_ghosts import DamageGhosts

pytestmark = pytest.mark.usefixtures("joined_stages")

STEPS, DT, END = 12, 2e-4, 4e-2


class Played(OneOfMany):
    """One of several processes that are played by one, each up to its exchange in turn.

    Args:
        more: Points by which its interior is too wide at both ends.
    """

    def __init__(self, made, rank, size, more=0):
        self.more = more
        super().__init__(made, rank, size)

    def set_partition(self, partition):
        inner, end = partition.inner, len(partition.points)
        inner = slice(max(inner.start - self.more, 0), min(inner.stop + self.more, end))
        super().set_partition(replace(partition, inner=inner))

    def exchange(self, fields, partition):
        addresses = frozenset(int(stored.array.ptr) for stored in fields)
        names = ", ".join(stored.name for stored in fields)
        return Call(names, "", 0, lambda: None, None, Touched(addresses, frozenset(), addresses))


@pytest.fixture
def streams(monkeypatch):
    """Exchanges are arranged as on a GPU: this machine may have none, and the tests play its streams."""
    monkeypatch.setattr(exchange, "has_streams", lambda device: True)


def process(made, rank, size, begin=True, more=0):
    built = compose(made, "cpu", None, Played(made, rank, size, more))
    if begin:
        begun(built)
    return built


def begun(built):
    for name in ("start", "setup"):
        run_once(built.context.device, built.context.stages[name])
    assign(built.context.state.step, np.array([DT]))
    built.set_clock(DT, END, 0.0)


def halo_of(context):
    return np.delete(np.arange(len(context.partition.points)), context.partition.owned)


def poison(context, names):
    for name in names:
        array = context.fields[name]
        values = to_host(array)
        at = halo_of(context)
        values[(slice(None), at) if name == "intact_bonds" else at] = np.nan if values.dtype.kind == "f" else 0
        assign(array, values)


def arrive(context, everyone, names):
    """Fill the halo with what its owners have now."""
    for name in names:
        values = to_host(context.fields[name])
        for other in everyone:
            theirs = other.context.partition
            mine = np.flatnonzero(np.isin(context.partition.points, theirs.points[theirs.owned]))
            mine = np.setdiff1d(mine, np.arange(*context.partition.owned.indices(len(context.partition.points))))
            at = np.searchsorted(theirs.points, context.partition.points[mine])
            found = to_host(other.context.fields[name])
            if name == "intact_bonds":
                values[:, mine] = found[:, at]
            else:
                values[mine] = found[at]
        assign(context.fields[name], values)


def played_step(everyone, number=0):
    """One step of all processes, what is on side streams as late as it may be."""
    for _ in zip(*(played(built, everyone, number) for built in everyone), strict=True):
        pass


def played(built, everyone, number):
    """One step of one process, which pauses where it needs the others."""
    items, later = built.context.stages["step"].round(number), []
    for item, waits in zip([*items, None], side_stream_waits(items), strict=True):
        if waits:
            for waiting in later:
                if isinstance(waiting, Call):
                    yield
                    arrive(built.context, everyone, waiting.name.split(", "))
                    yield
                else:
                    run_once(built.context.device, [waiting])
            later.clear()
        if isinstance(item, Call):
            assert item.side_stream
            poison(built.context, item.name.split(", "))
        if item is not None and item.side_stream:
            later.append(item)
        elif item is not None:
            run_once(built.context.device, [item])
    assert not later


def displacements(name, size, more=0):
    """Displacements of the own points of all processes after some steps, one after another."""
    everyone = [process(scene(name), rank, size, more=more) for rank in range(size)]
    assert any(item.divided for item in everyone[0].context.stages["step"])
    for number in range(STEPS):
        played_step(everyone, number)
    return np.concatenate([to_host(b.context.own(b.context.state.displacement)) for b in everyone])


def alone(name):
    built = scene(name).build(device="cpu")
    begun(built)
    for number in range(STEPS):
        run_once(built.context.device, built.context.stages["step"].round(number))
    return to_host(built.state.displacement)


@pytest.mark.parametrize(("name", "size"), [("loads", 2), ("torn", 3), ("hole", 2), ("visco", 2)])
def test_the_interior_does_not_wait_for_the_halo_and_leaves_the_same_bits(name, size, streams):
    expected = alone(name)
    assert np.abs(expected).max() > 0.0
    np.testing.assert_array_equal(displacements(name, size), expected)


def test_an_interior_one_row_too_wide_is_noticed(streams):
    assert not np.isfinite(displacements("loads", 2, more=33)).all()


def test_on_a_gpu_undamaged_families_do_not_wait_and_all_others_do(streams, gpu_paths, tune):
    """Declared on a CPU, not run."""
    tune(lattice_bonds=0)
    items = list(process(scene("torn"), 1, 3, begin=False).context.stages["step"])
    names = ["break_bonds", "undamaged_family_force"]
    divided = [(item.name, item.side_stream) for item in items if item.divided]
    parts = [(name, side) for name in names for side in (True, True, False)]
    assert [(name.split(", ")[0], side) for name, side in divided[1:]] == parts and divided[0][1]
    waits = dict(zip([item.name for item in items], side_stream_waits(items), strict=False))
    # What waits first is the kernel of all others, which the parts list.
    assert waits["family_block_force"] and not waits["undamaged_family_force"]


def stretched(built):
    """Stretch a sheet so far that it tears everywhere on one side, within a few steps."""
    x = built.context.sheet.points[:, 0]
    assign(built.context.state.displacement, np.stack([0.25 * x**2, 0.0 * x, 0.0 * x], axis=1))


@pytest.mark.parametrize(("size", "ring"), [(1, 2**19), (2, 2**19), (3, 2**19), (1, 400), (2, 400)])
def test_bonds_break_after_the_force_of_inner_points_and_leave_the_same_bits(
    size, ring, streams, gpu_paths, tune, monkeypatch
):
    """The kernel of undamaged families does not wait: families that are damaged after it are listed then.

    Of the strips of a large sheet this is so of the first. One process does so on a large sheet.
    """
    tune(lattice_bonds=0, ring=ring)
    alone = scene("field").build(device="cpu")
    # Exchanged before these processes begin.
    areas = alone.law.represented_areas()
    monkeypatch.setattr(DamageGhosts, "areas", lambda self, represented: areas[self.partition.points])
    if size == 1:
        monkeypatch.setattr(damage_field, "finds_at_once", lambda context: True)
        monkeypatch.setattr(damage_field, "MANY_POINTS", 0)
        everyone = [scene("field").build(device="cpu")]
        begun(everyone[0])
    else:
        everyone = [process(scene("field"), rank, size) for rank in range(size)]
    names = [item.name for item in everyone[0].context.stages["step"].round(0)]
    assert names.index("sweep") < names.index("undamaged_family_force") < names.index("finish")
    begun(alone)
    other = alone.law.other_families
    undamaged = [to_host(alone.law.intact)[0] == other.undamaged]
    for built in (alone, *everyone):
        stretched(built)
    for number in range(STEPS):
        run_once(alone.context.device, alone.context.stages["step"].round(number))
        played_step(everyone, number)
        undamaged.append(to_host(alone.law.intact)[0] == other.undamaged)
        for name in ("displacement", "damage_field"):
            parts = [to_host(built.context.own(built.context.fields[name])) for built in everyone]
            np.testing.assert_array_equal(np.concatenate(parts), to_host(alone.context.fields[name]))
    inner = to_host(other.family_class) == other.inner
    torn = [(inner & before & ~after).sum() for before, after in itertools.pairwise(undamaged)]
    assert sum(n > 10 for n in torn) > 1


def test_steps_between_two_looks_for_damage_overlap_as_those_without(streams, gpu_paths, tune):
    """Declared on a CPU, not run."""
    tune(lattice_bonds=0)
    step = process(scene("field"), 0, 2, begin=False).context.stages["step"]
    looks, between = step.round(0), step.round(1)
    assert step.interval == 2 and step.items == [*looks, *between]
    launches = [{item.name for item in items if isinstance(item, Launch)} for items in (looks, between)]
    assert launches[0] > launches[1] and {"wake", "drive", "finish"} <= launches[0] - launches[1]
    names = [item.name for item in between if item.divided]
    assert names == ["displacement", *2 * ["undamaged_family_force"]]
    waits = side_stream_waits(looks)
    assert next(item.name for item, wait in zip(looks, waits, strict=False) if wait) == "finish"


def test_an_exchange_waits_for_the_parts_around_an_earlier_one():
    def call(*writes):
        return Call("", "", 0, lambda: None, None, Touched(writes=frozenset(writes)), side_stream=True, divided=True)

    assert side_stream_waits([call(1), call(2)]) == [False, True, True]


@pytest.mark.parametrize("name", ["cloud", "relaxed"])
def test_blocks_that_share_points_are_divided_by_them(name, streams, gpu_paths):
    """Clouds, and sheets too small for a thread a point, have one kernel; declared on a CPU, not run."""
    context = process(scene(name), 1, 2, begin=False).context
    parts = [i for i in context.stages["step"] if i.name == "family_block_force"]
    assert all(part.divided for part in parts) and [part.side_stream for part in parts][-1] is False
    ranges = sorted(part.points for part in parts)
    assert ranges[0][0] <= context.partition.owned.start and ranges[-1][1] >= context.partition.owned.stop
    near = np.flatnonzero(context.partition.near)
    assert (ranges[0][0], ranges[-1][1]) == (near[0], near[-1] + 1)
    assert all(one[1] == other[0] for one, other in itertools.pairwise(ranges))
    inner = parts[-1]
    assert inner.points == (context.partition.inner.start, context.partition.inner.stop)
    for part in parts:
        begin, end = part.points
        assert part.arguments["blocks"] == -(-(end - begin) // part.span.together)
        assert part.threads == part.arguments["blocks"] * part.block_dim


def test_what_looks_first_is_divided_and_what_follows_it_waits():
    """As on several GPUs: an exchange, a look at all points, work on a list, and a force that needs none of it."""
    sent, listed, moved, force = range(1, 5)
    made = {
        "look": (("list", {listed}, {sent}), Span(10, 100)),
        "drive": (("list", {moved}, {sent, listed}), None),
        "force": (("point", {force}, {sent}), None),
    }
    items = [Call("sent", "", 0, lambda: None, None, Touched(writes=frozenset([sent])))]
    for name, ((per, writes, gathers), span) in made.items():
        source = SimpleNamespace(effects=Effects(per, frozenset(), frozenset()), kernel=None)
        given = {"start": 0, "stop": 100, "blocks": 10} if span else {}
        touched = Touched(gathers=frozenset(gathers), writes=frozenset(writes))
        items.append(Launch(name, "", source, 100, given, touched, 10, span=span))
    partition = SimpleNamespace(inner=slice(20, 90))
    found = overlap_exchanges(items, {id(items[0])}, partition, frozenset([sent, force]), lambda launch: True)
    assert [(item.name, item.side_stream) for item in found] == [
        ("sent", True), *(("look", side) for side in (True, True, False)), ("drive", True),
        *(("force", side) for side in (True, True, False)),
    ]  # fmt: skip
    assert [item.points for item in found if item.name == "look"] == [(0, 20), (90, 100), (20, 90)]
    assert not any(side_stream_waits(found)[:-1])
