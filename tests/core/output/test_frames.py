"""Frames read from the file of a run, one at a time."""

import h5py
import numpy as np
import pytest
from helpers import refused, square
from small_runs import simulate

from warp_pd import Explicit, Fixed, Frames, InputError, Newton, Pressure


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    sheet = square(7)
    velocity = np.zeros((sheet.size, 3))
    velocity[:, 2] = 1.0
    run = simulate(
        sheet, Explicit(0.01, frames=5), loads=[Fixed(sheet.edges("left"))], initial_velocity=velocity,
        fields=("stretch",),
    )  # fmt: skip
    return run.run(device="cpu", out=tmp_path_factory.mktemp("runs") / "a", usd=False)


def test_frames_are_those_of_the_run(result):
    frames = result.frames
    assert len(frames) == 6 and frames.points == 49
    assert frames.times == pytest.approx(np.linspace(0.0, 0.01, 6))
    last = frames[-1]
    assert last.index == 5 and last.time == pytest.approx(0.01) and last.when == "t = 0.01 s"
    assert last.displacement == pytest.approx(result.frame.displacement, abs=1e-9)
    assert last.positions == pytest.approx(result.built.simulation.sheet.positions + last.displacement, abs=1e-7)
    assert last.velocity == pytest.approx(result.frame.velocity, abs=1e-6)
    assert last["stretch_1"].shape == (49,) and last.triangles.shape == (72, 3)
    assert [frame.index for frame in frames] == list(range(6))
    assert frames.at(0.0041).index == 2


def test_slices_and_series_read_frames_when_they_are_asked(result):
    some, file = result.frames[1::2], result.folder / "frames.vtkhdf"
    file.rename(file.with_name("away"))
    try:
        assert len(some) == 3 and some.times == pytest.approx([0.002, 0.006, 0.01])
        with pytest.raises((InputError, OSError)):
            some[-1]
    finally:
        file.with_name("away").rename(file)
    assert some[-1].index == 5
    heights = some.series("displacement", [3, 48])
    assert heights.shape == (3, 2, 3) and (np.diff(heights[:, 1, 2]) != 0.0).all()
    assert result.frames.series("stretch_1", 4).shape == (6,)


def test_static_frames_say_the_load(tmp_path):
    sheet = square(7)
    result = simulate(
        sheet, Newton(load_steps=2), loads=[Fixed(sheet.edges("all")), Pressure(1.0)]
    ).run(device="cpu", out=tmp_path / "a", usd=False)  # fmt: skip
    assert [frame.when for frame in result.frames][1:] == ["load factor 0.5", "load factor 1"]


@pytest.mark.parametrize("mode", ["r", "r+"])
def test_a_file_that_is_open_is_not_called_damaged(result, mode):
    path = result.folder / "frames.vtkhdf"
    with h5py.File(path, mode), refused(match=r"it is open in this process; expected it to be closed first"):
        Frames(path)
    with h5py.File(path, mode, locking=False):
        assert len(Frames(path)) == 6


def test_what_is_not_there_is_one_line(result, tmp_path):
    (tmp_path / "bad.vtkhdf").write_text("no")
    for call, said in (
        (lambda: Frames(tmp_path), "expected the folder of a run that contains frames.vtkhdf"),
        (lambda: Frames(3), "path = 3"),
        (lambda: Frames(tmp_path / "bad.vtkhdf"), "expected a complete VTKHDF file of frames"),
        (lambda: result.frames[0]["damage"], "field 'damage': the frames hold displacement"),
        (lambda: result.frames.series("strech_1", 0), "did you mean 'stretch_1'"),
        (lambda: result.frames.series("stretch_1", 49), "points = 49: expected indices of 49 points"),
        (lambda: simulate(square(7), Explicit(1e-4, frames=1)).run(device="cpu").frames, "run(out='runs/mine')"),
    ):
        with refused(said):
            call()
    with pytest.raises(IndexError, match="expected -6 to 5"):
        result.frames[6]
