"""The problems, as every code is given them: sizes, material, supports and loads. NumPy alone: peers read it, too."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
NEAR = 1e-9
# Half the side of a held square in the middle, over that of the sheet: a cell of 25 points, four of 97.
MIDDLE = 1.0 / 24.0


@dataclass(frozen=True)
class Problem:
    """A flat rectangular sheet of rubber, W = mu/2 (I - 3) + K/8 (q + 1/q - 2), q = J^2, in plane stress.

    Attributes:
        name: Of the command line.
        title: Of the page, in words.
        size: Length and width [m].
        held: Names of the edges that are held.
        thickness: [m].
        mu: Shear modulus [Pa].
        bulk: K [Pa].
        density: [kg/m^3].
        pressure: Follower pressure upwards [Pa].
        stretch: To which the right edge is moved.
        prestretch: To which the sheet is stretched both ways before it is held.
        until: Time at which the sheet is looked at, after the pressure has come at once [s]; 0 for equilibrium.
        cut: Length of a cut along the middle, from the left [m]; the held edges are then moved apart until it grows.
        tearing_energy: Gc [J/m^2].
        ball: Radius of a rigid ball without friction at the middle [m]; 0 for none.
        ball_mass: [kg]. It touches the sheet from above at the start; without a mass it is below the sheet and stays.
        ball_speed: Downwards, at the start [m/s].
        gravity: Acceleration of the sheet, downwards [m/s^2].
        bending: Stiffness D of the sheet as a plate [N m]; Poisson's ratio is 1/2.
    """

    name: str
    title: str
    size: tuple[float, float]
    held: tuple[str, ...]
    thickness: float = 1e-4
    mu: float = 3e5
    bulk: float = 3e7
    density: float = 1000.0
    pressure: float = 0.0
    stretch: float = 1.0
    prestretch: float = 1.0
    until: float = 0.0
    cut: float = 0.0
    tearing_energy: float = math.inf
    ball: float = 0.0
    ball_mass: float = 0.0
    ball_speed: float = 0.0
    gravity: float = 0.0
    bending: float = 0.0

    def counts(self, points: int) -> tuple[int, int]:
        """Points along and across for `points` along the shorter side, both odd."""
        cells = max(2, 2 * (points // 2))
        shorter = min(self.size)
        along, across = (round(cells * side / shorter) + 1 for side in self.size)
        return along, across

    def grid(self, points: int) -> Array:
        """Places of a regular grid, row by row, (N, 2) [m]."""
        along, across = self.counts(points)
        x, y = np.meshgrid(np.linspace(0.0, self.size[0], along), np.linspace(0.0, self.size[1], across))
        return np.column_stack([x.ravel(), y.ravel()])

    def fixed(self, places: Array) -> Flags:
        """Which places are on held edges, (N,)."""
        x, y = places[:, 0] / self.size[0], places[:, 1] / self.size[1]
        on = {
            "left": x < NEAR, "right": x > 1.0 - NEAR, "bottom": y < NEAR, "top": y > 1.0 - NEAR,
            "middle": np.maximum(np.abs(x - 0.5), np.abs(y - 0.5)) < MIDDLE + NEAR,
        }  # fmt: skip
        return np.logical_or.reduce([on[name] for name in self.held])

    def start(self, places: Array) -> Array:
        """Displacement from which a solver may begin, and that of the held edges, (N, 3) [m].

        A uniform stretch; under pressure a dome of a fifth of the width, since a flat membrane resists none; for a
        drape a height of two thicknesses at most that has no mirror symmetry, so that the folds turn to one side.
        """
        x, y = places[:, 0] / self.size[0], places[:, 1] / self.size[1]
        rise = 0.2 * min(self.size) * (self.pressure > 0.0 and not self.until)
        height = 16.0 * rise * x * (1.0 - x) * y * (1.0 - y)
        if self.bending:
            u, v = 2.0 * x - 1.0, 2.0 * y - 1.0
            height = 5.2 * self.thickness * u * v * (u**2 - v**2) * ~self.fixed(places)
        return self.even(places) + np.outer(height, [0.0, 0.0, 1.0])

    def even(self, places: Array) -> Array:
        """The uniform stretch, which every code is given, (N, 3) [m]."""
        longer, wider = self.prestretch * self.stretch - 1.0, self.prestretch - 1.0
        return places @ np.array([[longer, 0.0, 0.0], [0.0, wider, 0.0]])

    def release_ratio(self, stretch: float) -> float:
        """G / Gc of a long cut at a stretch of the held edges: G = height W of pure shear (Rivlin and Thomas 1953)."""
        energy = 0.5 * self.mu * (stretch**2 + stretch**-2 - 2.0)
        return energy * self.size[1] / self.tearing_energy

    @cached_property
    def plane(self) -> bool:
        """Whether the sheet stays in its plane."""
        return self.pressure == 0.0 and not self.ball

    @cached_property
    def ball_at(self) -> tuple[float, float, float]:
        """Centre of the ball at the start [m]."""
        x, y = (0.5 * self.prestretch * side for side in self.size)
        return x, y, self.ball if self.ball_mass else -self.ball


PROBLEMS = {
    problem.name: problem
    for problem in (
        Problem(
            "pressure", "A square sheet, clamped all around, under a follower pressure, at rest", (0.1, 0.1),
            ("left", "right", "bottom", "top"), pressure=150.0,
        ),
        Problem(
            "strip", "A strip, gripped at its ends, pulled to 1.5 times its length", (0.2, 0.1), ("left", "right"),
            stretch=1.5,
        ),
        Problem(
            "drum", "A stretched square sheet, clamped all around, 6 ms after a pressure came at once", (0.1, 0.1),
            ("left", "right", "bottom", "top"), pressure=150.0, prestretch=1.1, until=6e-3,
        ),
        Problem(
            "ball", "A ball of 5 g dropped on a stretched square sheet, clamped all around, 10 ms after they touch",
            (0.1, 0.1), ("left", "right", "bottom", "top"), prestretch=1.1, until=1e-2,
            ball=0.02, ball_mass=5e-3, ball_speed=1.0,
        ),
        Problem(
            "drape", "A square sheet, held at its middle, draped over a ball, with folds, at rest", (0.2, 0.2),
            ("middle",), thickness=1e-3, ball=0.1, gravity=9.81, bending=1e-4,
        ),
        Problem(
            "tear", "A wide strip with a long cut, pulled across until the cut grows, with the tearing energy given",
            (0.14, 0.04), ("bottom", "top"), thickness=1e-3, mu=1e3, bulk=1e5, cut=0.05, tearing_energy=2.0,
        ),
    )
}  # fmt: skip
