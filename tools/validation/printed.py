"""Strips of a printed elastomer: whole, with a notch in both edges, and with two holes.

Strips were printed on three days, between which the material differs. Its experimenter calls it neo-Hookean, so one
modulus is all that a strip of the same day has to give. A notched strip that broke gives the tearing energy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import brentq
from study import whole
from treloar import DATA

from validation.comparison import Comparison, UnfinishedError, finished, median_deviation
from warp_pd import (
    BondAssociated,
    Circle,
    Explicit,
    Fixed,
    Measure,
    Motion,
    NeoHookean,
    Newton,
    Polygon,
    Sheet,
    Simulation,
    TearingEnergy,
)
from warp_pd.fitting import read_table
from warp_pd.measures import support_force
from warp_pd.scenes.edge_notch import AHEAD
from warp_pd.tearing.field_constants import DEFAULT_LENGTH

WIDE, HIGH, THICKNESS = 0.024, 0.048, 2.5e-3
HOLES = (Circle((0.016, 0.016), 4e-3), Circle((8e-3, 0.032), 4e-3))
# Forces and energies of strips are computed for a modulus of 1 MPa, and are proportional to it.
UNIT = NeoHookean(1e6, 1e8)
STROKES = np.array([0.0, 1.0, 2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0, 23.0, 26.0, 30.0]) * 1e-3
# Load steps between two of them.
LOAD_STEPS = 2
# Lengths of the computed notches [mm], before they are rounded to the grid.
NOTCHES = (0.5, 1.5, 2.5, 3.5, 4.5, 6.0, 7.5, 9.0)
# Points that a damage field takes at least: with fewer, the strip reaches the strength that goes with its length.
FIELD_POINTS = 49
# Largest forces [N], by the length of the notch [m]; those that give the tearing energy come first.
JUNE, MARCH = ((2.4e-3, 9.79), (1.2e-3, 12.91), (4.8e-3, 7.16)), ((3.6e-3, 10.14), (7.2e-3, 6.58))


def measured(*names: str) -> list[np.ndarray]:
    """Columns of the measurements, as far as all of them are known: strokes [m], forces [N]."""
    table = read_table(DATA.with_name("printed.csv")).columns
    known = np.all([np.isfinite(table[name]) for name in names], axis=0)
    return [table[name][known] for name in names]


def pulled(
    sheet: Sheet, strokes: np.ndarray, device: str | None, what: str, **law: object
) -> tuple[np.ndarray, np.ndarray]:
    """Forces [N] and energies [J] of a strip between clamps that move apart."""
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    times = np.linspace(0.0, 1.0, len(strokes))
    strip = Simulation(
        sheet,
        force=BondAssociated(UNIT, **law),
        loads=[
            Fixed(np.setdiff1d(np.arange(sheet.size), np.concatenate([top, bottom])), "z"),
            Fixed(bottom),
            Motion(top, times=times, x=0.0, y=strokes.tolist(), z=0.0),
        ],
        solver=Newton(load_steps=LOAD_STEPS * (len(strokes) - 1)),
        measures=[Measure("pull", "N", lambda built, frame: abs(support_force(built, top)[1]))],
    )
    rows = finished(strip, device, what)[LOAD_STEPS - 1 :: LOAD_STEPS]
    force, energy = (np.array([0.0, *(row[name] for row in rows)]) for name in ("pull", "strain"))
    return force, energy


def notched(points: int, notch: float) -> tuple[Sheet, float]:
    """The strip with a notch in both edges, and the length of the notches: they end midway between two columns."""
    spacing, rows = WIDE / (points - 1), 2 * (points - 1)
    sheet = Sheet.rectangle(WIDE, HIGH, thickness=THICKNESS, density=1000.0, points=(points, rows))
    if not notch:
        return sheet, 0.0
    length, middle = (np.floor(notch / spacing) + 0.5) * spacing, 0.5 * HIGH
    cut = sheet.cut((-WIDE, middle), (length, middle)).cut((WIDE - length, middle), (2.0 * WIDE, middle))
    return cut, length


@lru_cache
def family(points: int, device: str | None) -> tuple[RectBivariateSpline, RectBivariateSpline]:
    """Force [N] and energy [J] as functions of the length of the notches and the stroke, for a modulus of 1 MPa."""
    lengths, forces, energies = [], [], []
    for notch in (0.0, *(1e-3 * length for length in NOTCHES)):
        sheet, length = notched(points, notch)
        if lengths and length <= lengths[-1]:
            continue
        what = f"strip of {points} points with notches of {1e3 * length:.3g} mm"
        force, energy = pulled(sheet, STROKES, device, what, horizon=2.015)
        lengths, forces, energies = [*lengths, length], [*forces, force], [*energies, energy]
    return tuple(RectBivariateSpline(lengths, STROKES, values, s=0.0) for values in (forces, energies))


def strip_forces(points: int, notch: float, strokes: np.ndarray, device: str | None) -> np.ndarray:
    """Forces [N] at strokes [m], for a modulus of 1 MPa."""
    return np.asarray(family(points, device)[0](notch, strokes)[0])


def modulus(points: int, column: str, notch: float, strokes: str, device: str | None) -> float:
    """Modulus [MPa] of a day from one of its strips: least relative squares."""
    at, forces = measured(strokes, column)
    unit = strip_forces(points, notch, at, device) / forces
    return float(unit.sum() / (unit**2).sum())


def june(points: int, device: str | None) -> float:
    """Modulus [MPa] of June: from the whole strip."""
    return modulus(points, "whole", 0.0, "stroke", device)


def march(points: int, device: str | None) -> float:
    """Modulus [MPa] of March, from the strip with notches of 3.6 mm."""
    return modulus(points, "march_3_6", 3.6e-3, "read", device)


def notched_forces(points: int, device: str | None) -> Sequence[float]:
    """Forces [N] on the strip with notches of 4.8 mm."""
    at, _ = measured("stroke", "notched_4_8")
    return list(june(points, device) * strip_forces(points, 4.8e-3, at, device))


def other_notches(points: int, device: str | None) -> Mapping[str, float]:
    """The other notched strips that another strip of their day predicts."""
    cases = (("notched_2_4", 2.4e-3, "stroke", june), ("march_7_2", 7.2e-3, "read", march))
    found = {"modulus (MPa)": june(points, device)}
    for column, notch, strokes, of_day in cases:
        at, forces = measured(strokes, column)
        ours = of_day(points, device) * strip_forces(points, notch, at, device)
        found[f"median deviation with notches of {1e3 * notch:g} mm"] = median_deviation(list(ours), forces)
    return found


def holed_forces(points: int, device: str | None) -> Sequence[float]:
    """Forces [N] on the strip with two holes; its modulus is that of the notched strip of the same day."""
    at, _ = measured("read", "holed")
    corners = [(0.0, 0.0), (WIDE, 0.0), (WIDE, HIGH), (0.0, HIGH)]
    sheet = Sheet.outline(
        Polygon(corners), holes=HOLES, spacing=WIDE / (points - 1), thickness=THICKNESS, density=1000.0
    )
    what = f"strip of {points} points with holes"
    forces, _ = pulled(sheet, np.concatenate([[0.0], at]), device, what, horizon=1.5, weights="corrected")
    return list(modulus(points, "notched_3_6", 3.6e-3, "read", device) * forces[1:])


def release_rate(points: int, notch: float, stroke: float, device: str | None) -> float:
    """G [J/m^2] of each notch, for a modulus of 1 MPa: -dU / (2 t da)."""
    return -float(family(points, device)[1](notch, stroke, dx=1)[0, 0]) / (2.0 * THICKNESS)


def stroke_at(points: int, notch: float, force: float, device: str | None) -> float:
    """Stroke [m] at which a strip of 1 MPa bears a force [N]."""
    return float(brentq(lambda u: strip_forces(points, notch, np.array([u]), device)[0] - force, 0.0, STROKES[-1]))


def tearing_energy(points: int, day: Sequence[tuple[float, float]], modulus: float, device: str | None) -> float:
    """Tearing energy [J/m^2] of a day, from the largest force on its first strip."""
    notch, force = day[0]
    return modulus * release_rate(points, notch, stroke_at(points, notch, force / modulus, device), device)


def breaking_force(points: int, notch: float, energy: float, modulus: float, device: str | None) -> float:
    """Force [N] at which both notches of a strip run: G is the tearing energy [J/m^2].

    Raises:
        UnfinishedError: if G stays below the tearing energy at the largest computed stroke.
    """
    largest = modulus * release_rate(points, notch, STROKES[-1], device)
    if largest < energy:
        raise UnfinishedError(
            f"notches of {1e3 * notch:g} mm at {points} points: expected a G of {energy:.4g} J/m^2 within "
            f"{1e3 * STROKES[-1]:g} mm, got {largest:.4g}"
        )
    stroke = brentq(lambda u: modulus * release_rate(points, notch, u, device) - energy, STROKES[1], STROKES[-1])
    return modulus * float(strip_forces(points, notch, np.array([stroke]), device)[0])


def breaking_forces(points: int, device: str | None) -> Sequence[float]:
    """Largest forces [N] on the strips that did not give the tearing energy of their day."""
    found = []
    for day, of_day in ((JUNE, june), (MARCH, march)):
        mu = of_day(points, device)
        energy = tearing_energy(points, day, mu, device)
        found += [breaking_force(points, notch, energy, mu, device) for notch, _ in day[1:]]
    return found


def field(points: int) -> tuple[float, float]:
    """Length of the damage field [m], and how much longer a crack counts than its cut [m]."""
    length = DEFAULT_LENGTH * WIDE / (points - 1)
    return length, AHEAD * length


def resolved(points: int, notch: float) -> bool:
    """Whether the cut of a notch is at least two spacings long."""
    return notch - field(points)[1] >= 2.0 * WIDE / (points - 1)


def torn(points: int, notch: float, energy: float, modulus: float, device: str | None) -> float:
    """Largest mean force [N] in a frame on a strip that tears by the damage field.

    It is pulled so slowly that waves cross it 40 times.

    NaN if it does not break; what its halves do then does not count.
    """
    mu, duration, waves = 1e6 * modulus, 1.0, 40.0
    length, ahead = field(points)
    sheet = Sheet.rectangle(
        WIDE,
        HIGH,
        thickness=THICKNESS,
        density=mu * (duration / waves / HIGH) ** 2,
        points=(points, 2 * (points - 1)),
    )
    middle, cut = 0.5 * HIGH, notch - ahead
    sheet = sheet.cut((-WIDE, middle), (cut, middle)).cut((WIDE - cut, middle), (2.0 * WIDE, middle))
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    between = np.setdiff1d(np.arange(sheet.size), np.concatenate([top, bottom]))
    ends = sheet.where(lambda x, y: abs(y - middle) > 0.4 * HIGH)
    strip = Simulation(
        sheet,
        force=BondAssociated(NeoHookean(mu, 100.0 * mu), horizon=2.015),
        loads=[
            Fixed(between, "z"),
            Fixed(bottom),
            Motion(top, times=[0.0, duration], x=0.0, y=[0.0, STROKES[-1]], z=0.0),
        ],
        damage=TearingEnergy(energy, length, spared=ends),
        solver=Explicit(duration, frames=200, damping=20.0),
    )
    rows = whole(strip.run(device=device, usd=False, pictures=False)).history[1:]
    # Waves shake the grips once the strip has broken; the mean over a frame of the force on them does not count these.
    work, times = ([row[name] for row in rows] for name in ("external", "time"))
    forces = np.diff(work) / np.diff(times) * duration / STROKES[-1]
    largest = np.maximum.accumulate(forces)
    broken = np.flatnonzero(forces < 0.5 * largest)
    return float(largest[broken[0]]) if len(broken) else float("nan")


def by_field(points: int, device: str | None) -> Mapping[str, float]:
    """What the tearing energies are, and at which forces the damage field tears three strips of June with them."""
    mu = june(points, device)
    energy = tearing_energy(points, JUNE, mu, device)
    finer = max(points, FIELD_POINTS)
    ratios = {
        f"damage field of {1e3 * field(finer)[0]:g} mm over the test, notches of {1e3 * notch:g} mm": torn(
            finer, notch, energy, mu, device
        )
        / force
        for notch, force in JUNE
        if resolved(finer, notch)
    }
    return {
        "tearing energy in June (J/m^2)": energy,
        "in March": tearing_energy(points, MARCH, march(points, device), device),
        **ratios,
    }


def row(name: str, strokes: str, model: Callable, reasons: Callable | None = None) -> Comparison:
    """A comparison of forces at strokes."""
    at, forces = measured(strokes, name)
    return Comparison(
        name, tuple((1e3 * at).tolist()), tuple(forces.tolist()), WIDE, (25, 35, 49), (25, 49, 97), model, reasons
    )


ROWS: tuple[Callable[[], Comparison], ...] = (
    partial(row, "notched_4_8", "stroke", notched_forces, other_notches),
    partial(row, "holed", "read", holed_forces),
    lambda: Comparison(
        "breaking",
        tuple(f"{1e3 * notch:g} mm" for day in (JUNE, MARCH) for notch, _ in day[1:]),
        tuple(force for day in (JUNE, MARCH) for _, force in day[1:]),
        WIDE, (25, 35, 49), (25, 49, 97), breaking_forces, by_field,
    ),
)  # fmt: skip
