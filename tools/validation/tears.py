"""Notches, tear tests and the peel of rubber."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from treloar import DATA

from validation.comparison import Comparison, finished, outcome
from warp_pd import BondAssociated, Fixed, Motion, NeoHookean, Newton, Sheet, Simulation
from warp_pd.materials import energy_density
from warp_pd.scenes import peel
from warp_pd.scenes.pure_shear_tear import HEIGHT

MU = 1e3
STRIP, NOTCHES = 0.08, (6, 12)
# Load steps between two of STRETCHES: with one, a path once left its branch.
LOAD_STEPS = 3
STRETCHES = (1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0)


def energies(points: int, notch: float, device: str | None) -> np.ndarray:
    """Energy per thickness [J/m] of a strip in uniaxial tension that bears compression, at STRETCHES."""
    spacing, thickness = STRIP / (points - 1), 1e-3
    rows = 2 * (points - 1)
    sheet = Sheet.rectangle(
        STRIP, rows * spacing + spacing, thickness=thickness, density=1000.0, points=(points, rows + 2)
    )
    middle = 0.5 * (rows + 1) * spacing
    sheet = sheet.cut((-STRIP, middle), (notch, middle)) if notch else sheet
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    travel = [0.0, *((stretch - 1.0) * 2.0 * middle for stretch in STRETCHES)]
    times = np.linspace(0.0, 1.0, len(travel))
    pulled = Simulation(
        sheet,
        force=BondAssociated(NeoHookean(MU, 100.0 * MU), horizon=2.015),
        loads=[
            Fixed(np.arange(sheet.size), "z"),
            Motion(bottom, times=times, y=0.0),
            Motion(top, times=times, y=travel),
            Fixed([sheet.nearest(STRIP, 0.0), sheet.nearest(STRIP, 2.0 * middle)], "x"),
        ],
        solver=Newton(load_steps=LOAD_STEPS * len(STRETCHES)),
    )
    rows = finished(pulled, device, f"strip of {points} points with a notch of {1e3 * notch:g} mm")
    return np.array([row["strain"] for row in rows[LOAD_STEPS - 1 :: LOAD_STEPS]]) / thickness


def notch_factors(points: int, device: str | None) -> Sequence[float]:
    """Factors k of G = 2 k a W from two notches of 1/10 and 1/5 of the width.

    As dU/da = -G, U(0) - U(a) = k W a^2. The end of a notch is somewhere between two points: a slope of the root
    against a does not ask where.
    """
    spacing = STRIP / (points - 1)
    columns = [round(n * (points - 1) / 60) + 0.5 for n in NOTCHES]
    whole = energies(points, 0.0, device)
    short, long = (np.sqrt(whole - energies(points, column * spacing, device)) for column in columns)
    stretch = np.array(STRETCHES)
    density = energy_density(NeoHookean(MU, 100.0 * MU), stretch, stretch**-0.5, "cpu")
    return list(((long - short) / ((columns[1] - columns[0]) * spacing)) ** 2 / density)


def by_elements(points: int, device: str | None) -> Mapping[str, float]:
    """Finite elements of a neo-Hookean strip over the formula, a notch of 0.15 of the width."""
    torn = json.loads((DATA.parent / "torn.json").read_text("utf-8"))
    found = dict(zip(torn["stretches"], torn["full_energy"]["0.15"], strict=True))
    return {
        f"finite elements over the formula at {stretch:g}": found[stretch] / lindley(stretch)
        for stretch in (1.2, 1.5, 2.0, 3.0)
    }


def test_pieces(points: int, device: str | None) -> Sequence[float]:
    """G over Gc at which three test pieces tear; `points` are those of the trousers."""
    cases: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("pure_shear_tear", "onset_ratio", {"points": 2 * (points // 3), "frames": 150}),
        ("trousers", "tear_ratio", {"points": points, "frames": 100}),
        ("edge_notch", "onset_ratio", {"points": 4 * (points // 3), "frames": 100}),
    )
    return [outcome(scene, name, settings, device) for scene, name, settings in cases]


def peel_forces(points: int, device: str | None) -> Sequence[float]:
    """Force over that of the energy balance, peeled at 90 (T) and at 180 degrees."""
    width = peel.LENGTH / (points - 1) * (peel.ROWS - 1)
    return [
        outcome("peel", "force", {"points": points, "kind": kind}, device) / (peel.steady_state(kind, 100.0)[1] * width)
        for kind in ("T", "180")
    ]


def cutting_energies(points: int, device: str | None) -> Sequence[float]:
    """Cutting energy over Gc when tearing supplies a quarter, a half and three quarters of it."""
    settings = {"points": points, "frames": 80}
    return [
        outcome("cutting", "cutting_energy", {**settings, "opening": opening}, device) for opening in (0.25, 0.5, 0.75)
    ]


def slower_blade(points: int, device: str | None) -> Mapping[str, float]:
    """The same blade at half the speed, and of half the diameter."""
    settings = {"points": points, "frames": 80, "opening": 0.5}
    return {
        "half the speed": outcome("cutting", "cutting_energy", {**settings, "speed": 0.05}, device),
        "half the diameter": outcome("cutting", "cutting_energy", {**settings, "blade": 2.5e-4}, device),
    }


def lindley(stretch: float) -> float:
    """Factor k of Lindley's formula."""
    return float((2.95 - 0.08 * (stretch - 1.0)) / stretch**0.5)


ROWS: tuple[Callable[[], Comparison], ...] = (
    lambda: Comparison(
        "notch", STRETCHES, tuple(map(lindley, STRETCHES)), STRIP, (31, 61), (49, 97, 193), notch_factors, by_elements
    ),
    lambda: Comparison(
        "pieces", ("pure shear", "trousers", "edge notch"), (1.0, 1.0, 1.0), 0.02, (30,), (40, 60, 90), test_pieces
    ),
    lambda: Comparison("peel", ("90 (T)", "180 degrees"), (1.0, 1.0), peel.LENGTH, (31,), (61, 121), peel_forces),
    lambda: Comparison(
        "cutting", (0.25, 0.5, 0.75), (1.0, 1.0, 1.0), HEIGHT, (20,), (30, 40, 60), cutting_energies, slower_blade
    ),
)
