"""The file of the USD animation: readable whatever happens to the run, appended to, and wrong input refused."""

from __future__ import annotations

import functools
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import torn_frames
from torn_frames import FRAMES, make_frame, make_surface

from warp_pd.interfaces.frame import Surface

pytest.importorskip("pxr")

from pxr import Sdf, Usd, UsdGeom

from warp_pd.output.usd import SAVE_EVERY, UsdAnimation

SHEET = "/World/Sheet"
write_all = functools.partial(torn_frames.write_all, UsdAnimation)


@pytest.fixture(scope="module")
def surface() -> Surface:
    return make_surface()


def faces_of(mesh: UsdGeom.Mesh, index: int) -> np.ndarray:
    return np.array(mesh.GetFaceVertexIndicesAttr().Get(index)).reshape(-1, 3)


def test_killed_run_leaves_what_was_saved(tmp_path: Path) -> None:
    path = tmp_path / "animation.usd"
    torn_frames.write_until_killed(UsdAnimation, path, SAVE_EVERY + 5)
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh.Get(stage, SHEET)
    frames = len(mesh.GetPointsAttr().GetTimeSamples())
    assert frames >= SAVE_EVERY + 1
    assert stage.GetEndTimeCode() == frames - 1
    surface = make_surface()
    for index in range(frames):
        frame = make_frame(surface, index)
        np.testing.assert_allclose(mesh.GetPointsAttr().Get(index), frame.positions(surface), atol=1e-6)
        np.testing.assert_array_equal(faces_of(mesh, index), frame.faces(surface))
    # What the killed run left lying about is not in the way of the next one.
    write_all(path, frames, frames + 2, append_from=frames)
    assert Usd.Stage.Open(str(path)).GetEndTimeCode() == frames + 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["animation.usd"]


def text_of(path: Path) -> str:
    return Sdf.Layer.FindOrOpen(str(path)).ExportToString()


@pytest.mark.parametrize("first", [1, 4])
def test_appending_equals_writing_in_one_go(tmp_path: Path, first: int) -> None:
    write_all(tmp_path / "in_one_go.usd")
    parts, surface = tmp_path / "parts.usd", make_surface()
    with closing(UsdAnimation(parts, surface)) as animation:
        for index in range(FRAMES):
            healthy = index < first
            changes = {} if healthy else {"damage": np.ones(30), "intact_faces": np.zeros(40, bool)}
            animation.write(make_frame(surface, index, **changes))
    write_all(parts, first, append_from=first)
    assert text_of(parts) == text_of(tmp_path / "in_one_go.usd")


def test_source_of_an_append_stays_as_it_is_until_the_next_save(tmp_path: Path, surface: Surface) -> None:
    path = tmp_path / "animation.usd"
    write_all(path)
    before = path.read_bytes()
    animation = UsdAnimation(path, surface, append_from=3)
    animation.write(make_frame(surface, 3))
    assert path.read_bytes() == before
    animation.save()
    assert path.read_bytes() != before
    animation.close()


def test_rewriting_a_file_that_is_open_here(tmp_path: Path) -> None:
    path = tmp_path / "animation.usd"
    write_all(path)
    held = Usd.Stage.Open(str(path))
    abandoned = UsdAnimation(path, make_surface())
    abandoned.write(make_frame(abandoned.surface, 0))
    write_all(path, last=3)
    assert held.GetEndTimeCode() == 2
    assert len(UsdGeom.Mesh.Get(held, SHEET).GetPointsAttr().GetTimeSamples()) == 3


def test_half_a_frame_is_not_kept(tmp_path: Path, surface: Surface, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "animation.usd"
    with pytest.raises(KeyboardInterrupt), closing(UsdAnimation(path, surface)) as animation:
        animation.write(make_frame(surface, 0))
        # A kill within a frame.
        monkeypatch.setattr("warp_pd.output.usd.point_normals", interrupt)
        animation.write(make_frame(surface, 1))
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.Mesh.Get(stage, SHEET).GetPointsAttr().GetTimeSamples() == [0.0]
    assert not stage.GetAttributeAtPath(f"{SHEET}.faceVertexCounts").GetTimeSamples()[1:]


def interrupt(*_arguments, **_options) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(("name", "first"), [("short.usd", 3), ("broken.usd", 1), ("short.usd", -1)])
def test_a_file_that_does_not_go_on_is_refused_in_one_line(tmp_path: Path, name: str, first: int) -> None:
    write_all(tmp_path / "short.usd", last=2)
    (tmp_path / "broken.usd").write_bytes(b"PXR-USDC" + bytes(200))
    with pytest.raises(ValueError, match="expected") as caught:
        UsdAnimation(tmp_path / name, make_surface(), append_from=first)
    assert "\n" not in str(caught.value)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["broken.usd", "short.usd"]


def test_an_animation_without_frames_leaves_no_file(tmp_path: Path, surface: Surface) -> None:
    animation = UsdAnimation(tmp_path / "a.usd", surface)
    animation.close()
    animation.close()
    assert list(tmp_path.iterdir()) == []
