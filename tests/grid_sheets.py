"""Grids with gaps for the tests that share them: with holes, cuts, and points off the grid."""

from dataclasses import replace

import numpy as np
from helpers import square


def holed(points=31, radius=0.011):
    """A square with a hole off its middle."""
    return square(points).hole((0.047, 0.053), radius)


def partly_off_the_grid(points=31, seed=0):
    """A square with a hole, around which points are moved off the grid; these come first."""
    sheet = holed(points)
    near = np.hypot(*(sheet.points - (0.047, 0.053)).T) < 0.015
    order = np.argsort(~near, kind="stable")
    number = np.argsort(order)
    moved = sheet.points + np.random.default_rng(seed).uniform(-0.2, 0.2, (sheet.size, 2)) * sheet.spacing
    grid = np.where(near[:, None], -1, sheet.grid).astype(np.int32)
    return replace(
        sheet,
        points=np.where(near[:, None], moved, sheet.points)[order],
        areas=sheet.areas[order],
        triangles=number[sheet.triangles].astype(np.int32),
        grid=grid[order],
    )


def deep(built):
    """The points that share row 0."""
    return built.law.families.family_class == 0
