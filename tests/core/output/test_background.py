"""Frames are written in a thread, in order; errors come back; nothing is left unwritten."""

import errno
import threading

import pytest

from warp_pd.device.checks import OutputError
from warp_pd.output.background import Background


class Notes:
    """Notes frames, waits for a gate, and fails at a frame."""

    def __init__(self, fails_at=None):
        self.done, self.fails_at = [], fails_at
        self.threads = set()
        self.gate = threading.Event()
        self.gate.set()

    def __call__(self, frame):
        assert self.gate.wait(30.0)
        self.threads.add(threading.get_ident())
        if frame == self.fails_at:
            raise OSError(errno.ENOSPC, "disk full")
        self.done.append(frame)


def test_frames_are_written_in_order_by_another_thread():
    notes = Notes()
    writer = Background(notes)
    notes.gate.clear()
    writer.write(0)
    assert notes.done == []
    notes.gate.set()
    for frame in range(1, 5):
        writer.write(frame)
    writer.close()
    assert notes.done == [0, 1, 2, 3, 4]
    assert threading.get_ident() not in notes.threads


def test_saving_waits_for_the_frame_before():
    notes = Notes()
    writer = Background(notes)
    writer.write(7)
    writer.save()
    assert notes.done == [7]
    writer.close()


def test_work_waits_for_the_frame_before_in_the_thread_too():
    notes, work = Notes(), []
    writer = Background(notes)
    notes.gate.clear()
    writer.write(0)
    writer.then(lambda: work.append((threading.get_ident(), list(notes.done))))
    assert work == []
    notes.gate.set()
    writer.write(1)
    assert work == [(*notes.threads, [0])]
    writer.close()
    assert notes.done == [0, 1]


def test_no_work_follows_a_frame_that_was_not_written():
    work = []
    writer = Background(Notes(fails_at=0))
    writer.write(0)
    writer.then(lambda: work.append(0))
    with pytest.raises(OutputError, match="disk full"):
        writer.close()
    assert work == []


def test_an_error_is_raised_at_the_next_call():
    notes = Notes(fails_at=1)
    writer = Background(notes)
    writer.write(0)
    writer.write(1)
    with pytest.raises(OutputError, match="disk full"):
        writer.write(2)
    writer.close()
    assert notes.done == [0]


def test_an_error_in_the_last_frame_is_raised_at_closing():
    writer = Background(Notes(fails_at=0))
    writer.write(0)
    with pytest.raises(OutputError, match="disk full"):
        writer.close()
