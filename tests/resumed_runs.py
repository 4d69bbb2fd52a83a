"""A run that is stopped and resumed, against the same run that never stopped: every bit that it leaves."""

import json
from unittest.mock import patch

import numpy as np
from helpers import StopAt

# Seconds of the clock on the wall, which no two runs share.
TIMES = {"date", "wall_s", "setup_s", "compile_s", "point_steps_per_s", "step_seconds", "seconds"}


def without_times(values):
    """Nested values without the entries of TIMES."""
    if isinstance(values, dict):
        return {name: without_times(value) for name, value in values.items() if name not in TIMES}
    return [without_times(value) for value in values] if isinstance(values, list) else values


def restart_file(folder):
    """Arrays of the restart file, and its numbers."""
    with np.load(folder / "restart.npz") as stored:
        arrays = {name: stored[name] for name in stored.files}
    return arrays, without_times(json.loads(bytes(arrays.pop("numbers"))))


def require_same(one, other):
    """Compare two results with their files."""
    summary, other_summary = without_times(one.summary), without_times(other.summary)
    assert summary.keys() == other_summary.keys()
    for name, value in summary.items():
        assert value == other_summary[name], f"{name} in the summary: {value} and {other_summary[name]}"
    for row, other_row in zip(one.history, other.history, strict=True):
        assert row == other_row, f"row of the history: {row} and {other_row}"
    for name in ("displacement", "velocity", "damage", "intact_faces"):
        np.testing.assert_array_equal(getattr(one.frame, name), getattr(other.frame, name), err_msg=name)
    (arrays, numbers), (other_arrays, other_numbers) = restart_file(one.folder), restart_file(other.folder)
    for name, value in numbers.items():
        assert value == other_numbers[name], f"{name} in the restart file: {value} and {other_numbers[name]}"
    assert arrays.keys() == other_arrays.keys() >= {"displacement", "velocity"}
    for name, values in arrays.items():
        np.testing.assert_array_equal(values, other_arrays[name], err_msg=name)


# Otherwise a fast dynamic run that is stopped has the restart file of its start alone.
restarts_at_every_frame = patch("warp_pd.run.recorder.SECONDS_BETWEEN", 0.0)


@restarts_at_every_frame
def require_same_when_stopped(
    simulation, folder, frames, precision=None, status="finished", device="cpu", writers=lambda folder: []
):
    """Run a scene, then once more with a stop at each of some frames.

    Args:
        simulation: Makes the scene.
        folder: An empty one.
        frames: Where to stop, in order; the frame's restart file is not written.
        precision: 32, 64 or None.
        status: How the runs end.
        device: Where they run.
        writers: Makes the writers of a run from its folder, "complete" or "stopped" in `folder`.

    Returns:
        The result of the run that was never stopped.
    """
    options = {"device": device, "precision": precision, "usd": False, "pictures": False}
    complete = simulation().run(**options, out=folder / "complete", writers=writers(folder / "complete"))
    assert complete.status == status, complete.summary["message"]
    stopped = folder / "stopped"
    for number, frame in enumerate(frames):
        stopping = [*writers(stopped), StopAt(frame)]
        part = simulation().run(**options, out=stopped, resume=number > 0, writers=stopping)
        assert part.status == "interrupted"
        assert part.history[-1] == complete.history[frame], f"row of the history of frame {frame}"
    require_same(simulation().run(**options, out=stopped, resume=True, writers=writers(stopped)), complete)
    return complete
