"""Captured graphs."""

import gc
import weakref

import pytest

from warp_pd.device.graph import no_collection


class Node:
    """An object that refers to itself, so that the garbage collector alone frees it."""

    def __init__(self):
        self.itself = self


@pytest.fixture
def eager_collector():
    """A collector that runs after every few allocations."""
    before = gc.get_threshold()
    gc.set_threshold(1)
    yield
    gc.set_threshold(*before)


def allocate():
    return [[number] for number in range(1000)]


def test_no_garbage_is_freed_during_a_capture(eager_collector):
    freed = []
    with no_collection():
        weakref.finalize(Node(), freed.append, True)
        allocate()
        assert not freed
    assert gc.isenabled()
    allocate()
    gc.collect()
    assert freed


def test_a_collector_that_was_off_stays_off():
    gc.disable()
    try:
        with no_collection():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_the_collector_is_on_again_after_an_error():
    with pytest.raises(ZeroDivisionError), no_collection():
        _ = 1 / 0
    assert gc.isenabled()
