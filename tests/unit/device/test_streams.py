"""Streams of a GPU, played on a CPU: whatever the order in which streams run, the waits between them keep the bits."""

import numpy as np
import pytest
import warp as wp
from helpers import GENT, build, internal_force, sever, square

from warp_pd import CriticalStretch
from warp_pd.device import graph, streams
from warp_pd.device.launches import OfStrip
from warp_pd.laws import fast_path

CUT = ((0.02, 0.031), (0.071, 0.08))
STEPS = 3


@pytest.fixture
def strips(monkeypatch):
    """Kernels of a GPU on a CPU, one thread after another, with strips of a small sheet."""
    monkeypatch.setattr(fast_path, "shares_memory", lambda device: True)
    monkeypatch.setattr(graph, "SPLIT_FROM", float("inf"))
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    monkeypatch.setattr(fast_path, "MAX_SHARED", 0)
    monkeypatch.setattr(fast_path, "STRIPS_FROM", 0)
    monkeypatch.setattr(fast_path, "STRIP", 135)
    monkeypatch.setattr(fast_path, "RING", 250)


def pulled(tracked=True, torn=True):
    """A sheet that is pulled apart, with a cut, in which bonds break."""
    parts = {"damage": CriticalStretch(1.1), "track_energy": tracked} if torn else {}
    built = build(square(25), horizon=2.015, material=GENT, **parts)
    sheet = built.simulation.sheet
    if torn:
        sever(built, CUT)
    internal_force(built, np.zeros((sheet.size, 3)))
    x, y = sheet.points.T
    u = np.column_stack([0.1 * x + 4e-4 * np.sin(90.0 * y), -0.02 * y, 1e-3 * np.sin(70.0 * x)])
    built.state.displacement.assign(u)
    built.state.velocity.assign(np.column_stack([60.0 * x, 0.0 * y, 0.0 * y]))
    built.state.step.fill_(2e-5)
    return built


def left(built):
    fields = {**built.context.fields.kept(), "force": built.state.force}
    return {name: array.numpy().tobytes() for name, array in fields.items()}


def played(built, steps, choose):
    """Run steps in an order that the streams allow; `choose` picks the stream that goes on."""
    items = list(built.context.stages["step"]) * steps
    waits = streams.stream_waits(items)
    queues, done = {}, set()
    for number, item in enumerate(items):
        queue = queues.setdefault(streams.stream_of(item), [])
        for stream, awaited in waits[number]:
            # A stream that waits does so before whatever follows on it.
            queues.setdefault(stream, []).append(("wait", awaited))
        queue.append(("run", number))
    while any(queues.values()):
        ready = [s for s, queue in queues.items() if queue and (queue[0][0] == "run" or queue[0][1] in done)]
        stream = choose(sorted(ready))
        what, number = queues[stream].pop(0)
        if what == "run":
            graph.run_once(built.context.device, [items[number]])
            done.add(number)


CASES = {"undamaged": {"torn": False}, "torn": {"tracked": False}, "torn, energies": {"tracked": True}}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("whole", [False, True], ids=["strips", "whole"])
def test_any_order_of_the_streams_leaves_the_same_bits(strips, monkeypatch, case, whole):
    if whole:
        monkeypatch.setattr(fast_path, "STRIPS_FROM", 10**9)
        monkeypatch.setattr(fast_path, "RING", 10**9)
    in_order = pulled(**CASES[case])
    graph.run_once(in_order.context.device, list(in_order.context.stages["step"]) * STEPS)
    names = [item.name for item in in_order.context.stages["step"]]
    assert (names.count("undamaged_family_force") > 3) != whole
    rng = np.random.default_rng(0)
    orders = [min, max, lambda ready: streams.SIDE if streams.SIDE in ready else ready[0]]
    orders += [lambda ready: ready[rng.integers(len(ready))]] * 3
    for order in orders:
        built = pulled(**CASES[case])
        played(built, STEPS, order)
        assert left(built) == left(in_order)


def test_strips_have_the_bits_of_a_whole_sheet(strips, monkeypatch):
    results = []
    for least in (0, 10**9):
        monkeypatch.setattr(fast_path, "STRIPS_FROM", least)
        monkeypatch.setattr(fast_path, "RING", max(least, 250))
        built = pulled()
        before = built.law.intact.numpy().copy()
        graph.run_once(built.context.device, list(built.context.stages["step"]) * STEPS)
        assert (built.law.intact.numpy() != before).any()
        results.append(left(built))
    assert results[0] == results[1]


def test_a_strip_that_waits_for_none_before_it_is_noticed(strips, monkeypatch):
    """It gathers what others still compute, and the ring of the forces between points has room for few."""
    expected = pulled(torn=False)
    graph.run_once(expected.context.device, list(expected.context.stages["step"]) * STEPS)
    monkeypatch.setattr(OfStrip, "must_wait_for", lambda self, earlier: self.number == earlier.number)
    built = pulled(torn=False)
    played(built, STEPS, lambda ready: ready[0] if streams.SIDE != ready[0] else ready[-1])
    assert left(built) != left(expected)


def test_strips_take_little_memory(strips, monkeypatch):
    monkeypatch.setattr(fast_path, "STRIP", 201 * 9)
    built = build(square(201), horizon=3.15, material=GENT, precision=32)
    bond_force = next(stored for stored in built.context.fields if stored.name == "bond_force_ring")
    assert bond_force.nbytes < 0.3 * 28 * 12 * built.simulation.sheet.size
    assert built.context.fields.nbytes < 200 * built.simulation.sheet.size
