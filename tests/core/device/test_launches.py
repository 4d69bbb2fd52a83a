"""Launches: what they touch decides which share one, which wait, and what a stage runs."""

import contextlib
import functools
import gc
import weakref

import numpy as np
import pytest
import warp as wp

from warp_pd.context import find_device
from warp_pd.device import graph
from warp_pd.device.checks import InputError
from warp_pd.device.graph import LaunchSequence, side_stream_waits, wrapped
from warp_pd.device.launches import Stage, Touched
from warp_pd.kernels.effects import Effects, kernel, pointwise


@functools.cache
def add_kernel():
    """b[i] += a[i]."""

    @kernel()
    def add(a: wp.array(dtype=float), first: int, b: wp.array(dtype=float)):
        i = wp.tid() + first
        b[i] = b[i] + a[i]

    return add


@functools.cache
def shift_kernel():
    """pair = (2 pair[0], pair[0])."""

    @kernel(per="once")
    def shift(first: int, pair: wp.array(dtype=float)):
        pair[1] = pair[0]
        pair[0] = 2.0 * pair[0]

    return shift


@functools.cache
def add_first():
    """Pointwise stage: out[i] += source[0]."""

    @wp.struct
    class First:
        source: wp.array(dtype=float)
        out: wp.array(dtype=float)

    @pointwise(First, writes=("out",), gathers=("source",))
    def add_the_first(begin: int, end: int, a: First):
        for i in range(begin, end):
            a.out[i] = a.out[i] + a.source[0]

    return add_the_first


@functools.cache
def neighbour_sum():
    """Pointwise stage: out[i] = source[i - 1] + source[i + 1]."""

    @wp.struct
    class Neighbours:
        source: wp.array(dtype=float)
        out: wp.array(dtype=float)

    @pointwise(Neighbours, writes=("out",), gathers=("source",))
    def sum_neighbours(begin: int, end: int, a: Neighbours):
        for i in range(begin, end):
            n = a.source.shape[0]
            a.out[i] = a.source[(i + n - 1) % n] + a.source[(i + 1) % n]

    return sum_neighbours


@functools.cache
def twice():
    """Pointwise stage: out[i] = 2 source[i]."""

    @wp.struct
    class Twice:
        source: wp.array(dtype=float)
        out: wp.array(dtype=float)

    @pointwise(Twice, writes=("out",))
    def double(begin: int, end: int, a: Twice):
        for i in range(begin, end):
            a.out[i] = 2.0 * a.source[i]

    return double


def stage():
    return Stage("stage", "once", find_device("cpu"), 64, [])


def array(*values):
    return wp.array(values, dtype=float, device="cpu")


def run(made, repeat=1):
    LaunchSequence(made, repeat).run()


def test_pointwise_stages_on_the_same_points_share_a_launch():
    a, b, c = array(1.0, 2.0, 3.0), array(0.0, 0.0, 0.0), array(0.0, 0.0, 0.0)
    made = stage()
    with made.one_launch():
        made.pointwise("one", twice(), 3, source=a, out=b)
        made.pointwise("two", twice(), 3, source=b, out=c)
    assert len(made) == 1
    assert made.items[0].parts == ["double", "double"]
    assert made.items[0].owner == "one, two"
    run(made)
    np.testing.assert_array_equal(c.numpy(), [4.0, 8.0, 12.0])


def test_stages_outside_a_shared_launch_stay_apart():
    a, b = array(1.0, 2.0, 3.0), array(0.0, 0.0, 0.0)
    made = stage()
    made.pointwise("before", twice(), 3, source=a, out=b)
    with made.one_launch():
        made.pointwise("one", twice(), 3, source=a, out=b)
        with made.one_launch():
            made.pointwise("two", twice(), 3, source=a, out=b)
        made.pointwise("three", twice(), 3, source=a, out=b)
    made.pointwise("after", twice(), 3, source=a, out=b)
    assert [launch.owner for launch in made] == ["before", "one", "two, three", "after"]


@pytest.mark.parametrize("first", ["writer", "gatherer"])
def test_what_gathers_does_not_share_a_launch_with_what_it_gathers_from(first):
    """A point could see its neighbour before or after the other stage."""
    a, b, c = array(1.0, 2.0, 3.0), array(1.0, 1.0, 1.0), array(0.0, 0.0, 0.0)
    made = stage()
    stages = [("one", twice(), 3, {"source": a, "out": b}), ("two", neighbour_sum(), 3, {"source": b, "out": c})]
    with (
        made.one_launch(),
        pytest.raises(
            InputError, match=r"^(one: double and \w+ of two|two: \w+ and double of one) would share a launch"
        ),
    ):
        for *given, arrays in stages if first == "writer" else reversed(stages):
            made.pointwise(*given, **arrays)
    assert len(made) == 1


def test_other_points_keep_stages_apart():
    a, b = array(1.0, 2.0, 3.0), array(0.0, 0.0, 0.0)
    made = stage()
    with made.one_launch():
        made.pointwise("one", twice(), 3, source=a, out=b)
        made.pointwise("two", twice(), 2, source=a, out=b)
        made.pointwise("three", twice(), 2, source=a, out=b, begin=1)
    assert len(made) == 3


def test_a_kernel_between_two_stages_keeps_them_apart():
    a, b = array(1.0, 2.0, 3.0), array(0.0, 0.0, 0.0)
    made = stage()
    with made.one_launch():
        made.pointwise("one", twice(), 3, source=a, out=b)
        made.launch("two", add_kernel(), 3, a=a, b=b)
        made.pointwise("three", twice(), 3, source=b, out=a)
    assert [launch.name for launch in made] == ["double", "add", "double"]


def test_wraparound_is_the_stage_again_and_again():
    """The last launch of one repetition shares a launch with the first of the next."""
    results = []
    for fused in (False, True):
        a, b, c = array(1.0, 2.0, 3.0), array(0.0, 0.0, 0.0), array(0.0, 0.0, 0.0)
        made = stage()
        made.pointwise("one", twice(), 3, source=a, out=b)
        made.launch("two", add_kernel(), 3, a=b, b=c)
        made.pointwise("three", twice(), 3, source=c, out=a)
        if fused:
            made.fuse_wraparound()
        assert (made.wraparound is not None) == fused
        sequence = LaunchSequence(made, 5)
        assert len(sequence.items) == (11 if fused else 15)
        sequence.run()
        results.append([x.numpy() for x in (a, b, c)])
    np.testing.assert_array_equal(results[0], results[1])


def test_leading_launches_run_before_the_last_of_the_previous_repetition():
    """It then reads what they have left of the previous one: here the first entry of two."""
    results = []
    for late in (False, True):
        a, b, pair = array(1.0), array(0.0), array(1.0, 1.0)
        made = stage()
        # Moves the first entry on, which the second one keeps until then.
        with made.leads() if late else contextlib.nullcontext():
            made.launch("one", shift_kernel(), 1, pair=pair)
        made.pointwise("two", twice(), 1, source=a, out=b)
        made.launch("three", add_kernel(), 1, a=pair, b=b)
        made.pointwise("four", add_first(), 1, source=pair, out=a, late={"source": pair[1:]})
        made.fuse_wraparound()
        assert (made.wraparound is not None, made.leading) == (late, int(late))
        LaunchSequence(made, 5).run()
        results.append([x.numpy() for x in (a, b)])
    np.testing.assert_array_equal(results[0], results[1])


@pytest.mark.parametrize("reads", [False, True])
def test_leading_launches_run_beside_others_that_do_not_touch_their_arrays(reads):
    a, b, c, pair = array(1.0), array(0.0), array(1.0), array(1.0, 1.0)
    made = stage()
    with made.leads():
        made.launch("one", shift_kernel(), 1, pair=pair)
    made.pointwise("two", twice(), 1, source=pair, out=b)
    made.launch("three", add_kernel(), 1, a=pair if reads else c, b=b)
    made.pointwise("four", add_first(), 1, source=pair, out=a, late={"source": pair[1:]})
    made.fuse_wraparound()
    items = wrapped([made.round(k) for k in range(3)], made.wraparound, made.leading, True)
    names = [item.name for item in items]
    joined = "add_the_first, double"
    between = ["add", "shift", joined] if reads else ["shift", "add", joined]
    assert names == ["shift", "double", *between, *between, "add", "add_the_first"]
    assert [item.side_stream for item in items] == [
        name == "shift" and k > 0 and not reads for k, name in enumerate(names)
    ]
    waits = side_stream_waits(items)
    assert waits == [name == joined and not reads for name in names] + [False]


def test_what_runs_in_one_of_so_many_repetitions_runs_in_the_first():
    a, b = array(1.0, 2.0, 3.0), array(0.0, 0.0, 0.0)
    made = stage()
    made.pointwise("one", twice(), 3, source=a, out=a)
    with made.every(3):
        made.launch("two", add_kernel(), 3, a=a, b=b)
    made.pointwise("three", twice(), 3, source=a, out=a)
    made.fuse_wraparound()
    assert made.interval == 3
    sequences = [LaunchSequence(made, repeat, begin) for repeat, begin in ((4, 0), (1, 1), (1, 2), (1, 3))]
    assert [[name for item in made.items for name in item.parts].count("add") for made in sequences] == [2, 0, 0, 1]
    sequences[0].run()
    # Each repetition doubles twice: what is added after the first doubling of repetitions 0 and 3.
    np.testing.assert_array_equal(a.numpy(), 256.0 * np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(b.numpy(), 130.0 * np.array([1.0, 2.0, 3.0]))


def test_wraparound_is_left_out_where_the_next_step_gathers():
    a, b, c = array(1.0, 2.0, 3.0), array(0.0, 0.0, 0.0), array(0.0, 0.0, 0.0)
    made = stage()
    made.pointwise("one", neighbour_sum(), 3, source=a, out=b)
    made.launch("two", add_kernel(), 3, a=b, b=c)
    made.pointwise("three", twice(), 3, source=c, out=a)
    made.fuse_wraparound()
    assert made.wraparound is None


def test_launches_wait_for_the_side_stream_where_they_touch_its_arrays():
    a, b, c, d = (array(0.0, 0.0) for _ in range(4))
    made = stage()
    made.launch("side", add_kernel(), 2, side_stream=True, a=a, b=b)
    made.launch("beside", add_kernel(), 2, a=c, b=d)
    made.launch("reader", add_kernel(), 2, a=b, b=d)
    made.launch("later", add_kernel(), 2, a=b, b=c)
    assert side_stream_waits(list(made)) == [False, False, True, False, False]


@pytest.mark.parametrize("touches", ["reads what it writes", "writes what it writes", "writes what it reads"])
def test_every_conflict_waits(touches):
    a, b, c = (array(0.0, 0.0) for _ in range(3))
    made = stage()
    made.launch("side", add_kernel(), 2, side_stream=True, a=a, b=b)
    arguments = {"reads": {"a": b, "b": c}, "writes what it w": {"a": c, "b": b}, "writes what it r": {"a": c, "b": a}}
    made.launch("other", add_kernel(), 2, **next(v for k, v in arguments.items() if touches.startswith(k)))
    assert side_stream_waits(list(made)) == [False, True, False]


def test_launches_on_a_condition_wait_for_the_side_stream():
    a, b, c, d = (array(0.0, 0.0) for _ in range(4))
    needed = wp.array([1], dtype=wp.int32, device="cpu")
    made = stage()
    made.launch("side", add_kernel(), 2, side_stream=True, a=a, b=b)
    for name in ("first", "second"):
        made.launch(name, add_kernel(), 2, only_if=needed, grouped=True, a=c, b=d)
    assert side_stream_waits(list(made)) == [False, True, False, False]


def test_a_stage_ends_with_the_side_stream():
    a, b = array(0.0, 0.0), array(0.0, 0.0)
    made = stage()
    made.launch("side", add_kernel(), 2, side_stream=True, a=a, b=b)
    assert side_stream_waits(list(made)) == [False, True]


def test_reading_together_is_no_conflict():
    one, other = Touched(frozenset({1}), frozenset({2}), frozenset({3})), Touched(frozenset({1, 2}))
    assert not other.must_wait_for(one)
    assert one.may_share_launch(other)
    assert not one.may_share_launch(Touched(writes=frozenset({2})))
    assert not Touched(gathers=frozenset({3})).may_share_launch(one)
    # At the own point they may: a stage after another in one launch sees what that wrote.
    assert one.may_share_launch(Touched(reads=frozenset({3})))


@pytest.mark.parametrize("arguments", [{"a": None}, {"a": None, "b": None, "c": None}])
def test_arguments_are_compared_by_name(arguments):
    made = stage()
    with pytest.raises(TypeError, match="launch of add: missing"):
        made.launch("one", add_kernel(), 2, **arguments)
    with pytest.raises(TypeError, match="pointwise stage double: missing"):
        made.pointwise("one", twice(), 2, **arguments)


def test_effects_know_what_a_thread_works_on():
    with pytest.raises(ValueError, match="per = 'bond': expected one of"):
        Effects("bond", frozenset())
    # What works on a list of points may read any of them.
    made = stage()

    @kernel(per="list")
    def pick(points: wp.array(dtype=int), a: wp.array(dtype=float), first: int, b: wp.array(dtype=float)):
        i = points[wp.tid() + first]
        b[i] = a[i]

    a, b = array(0.0, 1.0), array(0.0, 0.0)
    made.launch("one", pick, 1, points=wp.array([1], dtype=int, device="cpu"), a=a, b=b)
    assert a.ptr in made.items[0].touched.gathers
    assert made.items[0].touched.writes == {b.ptr}


def test_a_kernel_without_first_is_named():
    with pytest.raises(ValueError, match="kernel add_one: expected an argument `first`"):

        @kernel()
        def add_one(a: wp.array(dtype=float)):
            a[wp.tid()] = 1.0


@pytest.mark.parametrize("split_from", [0.0, np.inf], ids=["slices", "whole"])
def test_a_launch_that_takes_long_is_split_over_the_cores(split_from, monkeypatch):
    monkeypatch.setattr(graph, "SPLIT_FROM", split_from)
    monkeypatch.setattr(graph, "available_cores", lambda: 3)
    a, b = (wp.array(np.arange(1000.0, dtype=np.float32), device="cpu") for _ in range(2))
    made = stage()
    made.pointwise("one", twice(), 1000, source=a, out=b)
    made.launch("two", add_kernel(), 1000, a=a, b=b)
    launches = [graph.CpuLaunch(item, made.device) for item in made]
    for _ in range(graph.TIMED_RUNS + 2):
        for launch in launches:
            launch.run()
    assert [len(launch.slices) for launch in launches] == ([3, 3] if split_from == 0.0 else [1, 1])
    np.testing.assert_array_equal(b.numpy(), 3.0 * np.arange(1000.0))


def test_a_launch_that_took_long_in_an_earlier_run_is_split_from_the_first(monkeypatch):
    monkeypatch.setattr(graph, "SPLIT_FROM", 0.0)
    monkeypatch.setattr(graph, "available_cores", lambda: 2)

    def launch(points, size):
        made = stage()
        made.launch("one", add_kernel(), points, a=array(*[1.0] * size), b=array(*[0.0] * size))
        return graph.CpuLaunch(next(iter(made)), made.device)

    for number in range(graph.TIMED_RUNS):
        again = launch(1200, 1201)
        assert len(again.slices) == 1, number
        again.run()
    again = launch(1200, 1201)
    assert len(again.slices) == 2
    again.run()
    assert again.item.arguments["b"].numpy().tolist() == [1.0] * 1200 + [0.0]
    # Other shapes, and few points.
    assert len(launch(1200, 1202).slices) == len(launch(900, 1201).slices) == 1


def test_a_launch_with_one_thread_is_not_split(monkeypatch):
    monkeypatch.setattr(graph, "SPLIT_FROM", 0.0)
    monkeypatch.setattr(graph, "available_cores", lambda: 3)
    made = stage()
    made.launch("two", add_kernel(), 1, a=array(1.0), b=array(1.0))
    launch = graph.CpuLaunch(next(iter(made)), made.device)
    for _ in range(graph.TIMED_RUNS + 1):
        launch.run()
    assert len(launch.slices) == 1


def test_a_kernel_that_was_recorded_takes_other_arrays_of_the_same_types_alone():
    kernel, cpu = add_kernel(), find_device("cpu")

    def added(a, b):
        made = Stage("add", "", cpu, 64, [])
        made.launch("test", kernel, len(b), a=a, b=b)
        LaunchSequence(made).run()
        return b.numpy().tolist()

    def array(*values, kind=float):
        return wp.array(values, dtype=kind, device=cpu)

    first = array(1.0, 2.0)
    gone = weakref.ref(first)
    assert added(first, array(1.0, 1.0)) == [2.0, 3.0]
    assert added(array(5.0, 6.0, 7.0), array(1.0, 1.0, 1.0)) == [6.0, 7.0, 8.0]
    del first
    gc.collect()
    assert gone() is None
    with pytest.raises(RuntimeError, match="dtype"):
        added(array(1.0, 2.0, kind=wp.float64), array(1.0, 1.0))
