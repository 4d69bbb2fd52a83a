"""The cases, in the order of the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from warp_pd import Sheet

from ..laws import Rubber, Trial
from ..motion import square
from ..verdicts import Finding, short
from .bonds import few_bonds
from .geometry import cloud, graded, units_and_thickness
from .long_runs import oscillation, spin
from .material import LOCK_RATIO, past_lock, relaxing, stiffness
from .rupture import ball, break_all, repeat_run, restart_run
from .shapes import (
    compression,
    inside_out,
    point_beside_neighbour,
    point_past_neighbour,
    put_point,
    turned_sheet,
    zero_energy,
)
from .step import step_bound


@dataclass(frozen=True)
class StabilityCase:
    """One row of the table.

    Attributes:
        name: In the table, and for --only.
        number: What the number is.
        find: The case.
        fast: Whether it belongs to --fast.
    """

    name: str
    number: str
    find: Callable[[Trial], Finding]
    fast: bool = False


def jittered(points: int, jitter: float) -> Sheet:
    """A square cloud whose points are moved at random, by up to a share of the spacing."""
    return Sheet.filled(1.0, 1.0, thickness=0.01, density=1e3, points=points, jitter=jitter)


ENERGY = "energy error"
STRESS = "error of the mean stress"
MOTION = "change of the motion"
SHARE = "stable share of the estimate"
BYTES = "bytes that differ"
CASES: tuple[StabilityCase, ...] = (
    *(
        StabilityCase(f"K/mu = {short(ratio)}", STRESS, stiffness(Rubber(ratio=ratio)), fast=ratio in (1.0, 1e6))
        for ratio in (1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
    ),
    *(
        StabilityCase(
            f"99 % of the lock, Jm = {short(lock)}",
            STRESS,
            stiffness(Rubber(lock=lock, ratio=LOCK_RATIO), 0.99),
            fast=lock == 1.0,
        )
        for lock in (200.0, 50.0, 10.0, 3.0, 1.0)
    ),
    StabilityCase("stretched beyond the lock, Jm = 20", ENERGY, past_lock, fast=True),
    *(StabilityCase(f"relaxation in {short(time)} s", ENERGY, relaxing(time)) for time in (1e-9, 1e-3, 1e9)),
    *(
        StabilityCase(f"thickness {short(h)} of the side", MOTION, units_and_thickness(thickness=h), fast=h == 1e-6)
        for h in (1e-6, 1e-3, 1.0)
    ),
    StabilityCase("units: millimetres", MOTION, units_and_thickness(length=1e3), fast=True),
    StabilityCase("units: kilometres", MOTION, units_and_thickness(length=1e-3), fast=True),
    StabilityCase("step: at rest", SHARE, step_bound(square, 1.0, 1.0)),
    StabilityCase("step: stretched", SHARE, step_bound(square, 1.3, 1.1), fast=True),
    StabilityCase("step: jittered, stretched", SHARE, step_bound(lambda: jittered(9, 0.4), 1.3, 1.1)),
    StabilityCase("cloud: jittered by 0.45", ENERGY, cloud(lambda: jittered(11, 0.45)), fast=True),
    StabilityCase("cloud: graded 10:1", ENERGY, cloud(graded)),
    StabilityCase("one bond", ENERGY, few_bonds([(12, 13)]), fast=True),
    StabilityCase("two bonds", ENERGY, few_bonds([(12, 13), (12, 17)])),
    StabilityCase("collinear bonds", ENERGY, few_bonds([(10, 11), (11, 12), (12, 13), (13, 14), (10, 12), (12, 14)])),
    StabilityCase("a chain", ENERGY, few_bonds([(0, 6), (6, 7), (7, 13), (13, 14), (14, 18), (18, 22)])),
    StabilityCase("an isolated point", ENERGY, few_bonds([])),
    StabilityCase("zero-energy excitations", "softest frequency over the largest", zero_energy, fast=True),
    StabilityCase("sheet turned by 90°", "change of the forces", turned_sheet(90.0)),
    StabilityCase("sheet turned by 180°", "change of the forces", turned_sheet(180.0), fast=True),
    StabilityCase("sheet inside out", "force over mu h dx", inside_out),
    StabilityCase("a bond turned by 90°", ENERGY, put_point(point_beside_neighbour)),
    StabilityCase("a bond turned by 180°, inversion", ENERGY, put_point(point_past_neighbour), fast=True),
    StabilityCase("compression to half size", ENERGY, compression, fast=True),
    StabilityCase("ball at the wave speed", ENERGY, ball(1.0)),
    StabilityCase("ball at 10 times", ENERGY, ball(10.0)),
    StabilityCase("ball at 100 times", ENERGY, ball(100.0), fast=True),
    StabilityCase("every bond in one step", ENERGY, break_all, fast=True),
    StabilityCase("restart in the middle of a tear", BYTES, restart_run, fast=True),
    StabilityCase("two runs on one device", BYTES, repeat_run, fast=True),
    StabilityCase("rigid spin", "drift", spin, fast=True),
    StabilityCase("undamped oscillation", "drift of the energy", oscillation, fast=True),
)
