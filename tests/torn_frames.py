"""Frames of a small sheet that tears under a ball, for the tests of writers."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np

from warp_pd import Sphere
from warp_pd.interfaces.frame import Body, Frame, Surface

COLUMNS, ROWS, FRAMES = 6, 5, 7
BALL = Body("ball", "sphere", (0.05,), *Sphere(0.1).outline(0.0))


def make_surface(**changes) -> Surface:
    """A sheet of 6 x 5 points, 0.5 m x 0.4 m, with a ball above it."""
    points = np.array([[0.1 * column, 0.1 * row, 0.0] for row in range(ROWS) for column in range(COLUMNS)])
    corners = [row * COLUMNS + column for row in range(ROWS - 1) for column in range(COLUMNS - 1)]
    faces = np.array([triangle for a in corners for triangle in ((a, a + 1, a + 7), (a, a + 7, a + 6))], np.int32)
    values = {
        "points": points,
        "faces": faces,
        "title": "tear",
        "metadata": {"version": "1", "points": 30},
        "bodies": (BALL,),
    }
    return Surface(**{**values, **changes})


def make_frame(surface: Surface, at: int, **changes) -> Frame:
    """The ball pushes the middle down; from frame 2 on a tear runs from the left, one column a frame."""
    x, y = surface.points[:, 0], surface.points[:, 1]
    displacement = np.zeros_like(surface.points)
    displacement[:, 2] = -0.02 * at * np.sin(np.pi * x / 0.5) * np.sin(np.pi * y / 0.4)
    centres = surface.points[surface.faces].mean(axis=1)
    torn = (np.abs(centres[:, 1] - 0.2) < 0.1) & (centres[:, 0] < 0.1 * (at - 1))
    values = {
        "index": at,
        "time": 0.01 * at,
        "displacement": displacement,
        "velocity": np.full_like(surface.points, 0.1 * at),
        "intact_faces": ~torn,
        "damage": np.clip(2.0 * at / FRAMES - 4.0 * x, 0.0, 1.0),
        "bodies": np.array([[0.25, 0.2, 0.06 - 0.02 * at, 0.0, 0.0, 0.0, 1.0]]),
    }
    return Frame(**{**values, **changes})


def make_frame_with_fields(surface: Surface, at: int, **changes) -> Frame:
    """The same, with further fields of the points."""
    x = surface.points[:, 0]
    fields = {
        "stress": 1e5 * x * at,
        "force": surface.points * at,
        "bonds": np.arange(30) - at,
        "held": x == 0.0,
    }
    return make_frame(surface, at, **{"point_data": fields, **changes})


def write_all(writer, path, first=0, last=FRAMES, frame=make_frame, **options) -> Surface:
    """The frames first to last - 1, written by a class of writers."""
    surface = make_surface()
    open_file = writer(path, surface, **options)
    for index in range(first, last):
        open_file.write(frame(surface, index))
    return surface


WRITE_FOREVER = """
import importlib, sys, torn_frames
module, writer, frame, path = sys.argv[1:]
surface = torn_frames.make_surface()
opened = getattr(importlib.import_module(module), writer)(path, surface)
for index in range(10**6):
    opened.write(getattr(torn_frames, frame)(surface, index))
    print(index, flush=True)
"""


def write_until_killed(writer, path, frames, frame=make_frame) -> None:
    """Another process writes frames, and is killed after so many."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITE_FOREVER, writer.__module__, writer.__name__, frame.__name__, str(path)],
        stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
    )  # fmt: skip
    while int(process.stdout.readline()) < frames:
        pass
    process.kill()
    assert process.wait() == -signal.SIGKILL
    process.stdout.close()
