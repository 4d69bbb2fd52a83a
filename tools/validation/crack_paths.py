"""Paths of cracks: the kink of an inclined crack, and two cracks that pass each other."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from study import whole

from validation.comparison import Comparison, UnfinishedError
from warp_pd import BondAssociated, Fixed, Motion, NeoHookean, Newton, Sheet, Simulation, TearingEnergy
from warp_pd.geometry.triangulation import joined_points
from warp_pd.tearing.cut_profiles import CutEnds

MU, BULK, DENSITY, THICKNESS = 1e3, 1e5, 1000.0, 1e-3
# Small against MU times any length here, as the sheets of both sources hardly stretch [J/m^2].
TEARING_ENERGY = 0.2
WIDE = 0.1

# An inclined crack: angles to the line across the load, half its length, length of the damage field [m].
ANGLES = (15.0, 30.0, 45.0, 60.0)
HALF, FIELD = 0.015, 1.9e-3
# Distances from its start, in lengths of the field, between which the new crack is seen: farther away it turns
# until it is across the load. It need not grow beyond GROWN from the tip. Damage of the band that counts as the crack.
NEAR, FAR, GROWN, CRACKED = 1.0, 3.0, 6.0, 0.6
# Pull over that at which the largest tangential stress has the intensity of TEARING_ENERGY.
OVERLOAD = 1.35

# Two cracks that pass each other: a sheet pulled at its short sides, with a notch in each long one.
HIGH, NOTCH, OFFSET = 0.2, 0.025, 0.026
# Pull over the length of the sheet, and load steps up to it: small where the cracks start, which leaves them little
# overload.
STARTS, STEPS = (0.026, 0.036), (2, 10, 23)


def torn(
    sheet: Sheet,
    travels: Sequence[float],
    load_steps: Sequence[int],
    length: float,
    spared: np.ndarray,
    device: str | None,
    horizon: float = 1.5,
) -> tuple[np.ndarray, np.ndarray]:
    """Damage and intact faces of a sheet whose upper and lower edges were moved apart.

    Newton's method and the damage field take turns, so cracks have no inertia: they are slow also where the load would
    have to fall.

    Args:
        sheet: Cut or notched.
        travels: Of the edges, one after the other, each from the last [m].
        load_steps: Number of equal parts of each.
        length: Of the damage field [m].
        spared: Points that do not tear.
        device: Where it runs.
        horizon: In spacings.
    """
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    times = [0.0, *(np.cumsum(load_steps) / np.sum(load_steps)).tolist()]
    way = [0.0, *(0.5 * travel for travel in travels)]
    result = whole(
        Simulation(
            sheet,
            force=BondAssociated(NeoHookean(MU, BULK), horizon=horizon),
            loads=[
                Fixed(np.arange(sheet.size), "z"),
                Motion(top, times=times, x=0.0, y=way),
                Motion(bottom, times=times, x=0.0, y=[-y for y in way]),
            ],
            damage=TearingEnergy(TEARING_ENERGY, length=length, spared=spared),
            solver=Newton(load_steps=int(np.sum(load_steps))),
        ).run(device=device, usd=False, pictures=False)
    )
    if result.status != "finished":
        raise UnfinishedError(f"a sheet of {sheet.size} points: the run ended {result.status!r}")
    return result.frame.damage, result.frame.intact_faces


@functools.cache
def grown(
    points: int, angle: float, device: str | None, turn: float = 0.0, horizon: float = 1.5
) -> tuple[float, float]:
    """Angles between an inclined crack and its growth [degrees], means of both ends.

    Seen from where the damage of the cut ends, where growth begins, and from the tip of the cut.

    Args:
        points: Along each edge of the square sheet.
        angle: Of the crack to the line across the load [degrees].
        device: Where it runs.
        turn: Of the grid [degrees].
        horizon: In spacings.
    """
    sheet = Sheet.filled(WIDE, WIDE, thickness=THICKNESS, density=DENSITY, points=(points, points), turn=turn)
    along = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    apart = {sign: sheet.points[:, :2] - 0.5 * WIDE - sign * HALF * along for sign in (-1.0, 1.0)}
    far = np.flatnonzero(np.minimum(*(np.hypot(*of_tip.T) for of_tip in apart.values())) > GROWN * FIELD)
    strain = OVERLOAD * (TEARING_ENERGY / (3.0 * MU * np.pi * HALF)) ** 0.5 / intensity(angle)
    sheet = sheet.cut(tuple(0.5 * WIDE - HALF * along), tuple(0.5 * WIDE + HALF * along))
    damage, _ = torn(sheet, [strain * WIDE], [5], FIELD, far, device, horizon)
    recess = CutEnds.of(sheet, FIELD).recesses(FIELD, sheet.spacing).max()
    from_damage, from_tip = (
        np.mean([angle - new_line(sign * of_tip + back * along, damage, along) for sign, of_tip in apart.items()])
        for back in (recess, 0.0)
    )
    return float(from_damage), float(from_tip)


def new_line(places: np.ndarray, damage: np.ndarray, along: np.ndarray) -> float:
    """Direction of the middle of the new crack [degrees].

    Args:
        places: Of the points, from where the crack began [m], (N, 2).
        damage: Of the points, (N,).
        along: Direction in which the old crack points, (2,).
    """
    distance = np.hypot(*places.T) / FIELD
    new = places[(distance > NEAR) & (distance < FAR) & (places @ along > 0.0) & (damage > CRACKED)]
    if not len(new):
        raise UnfinishedError(f"a sheet of {len(places)} points: its crack did not grow {NEAR:g} lengths of the field")
    return float(np.rad2deg(np.arctan2(*new.mean(axis=0)[::-1])))


def kinks(points: int, device: str | None) -> Sequence[float]:
    """Kinks at ANGLES."""
    return [grown(points, angle, device)[0] for angle in ANGLES]


def what_moves_kinks(points: int, device: str | None) -> Mapping[str, float]:
    """The crack of 30 degrees, which grows across a turned grid; the tip of the cut; the formula away from the tip."""
    # No weights balance a turned grid at a horizon of 1.5 spacings.
    turned = {
        f"at 30 degrees, horizon 2.015, grid turned by {turn:g} degrees": grown(points, 30.0, device, turn, 2.015)[0]
        for turn in (0.0, 20.0)
    }
    seen = {f"from the tip of the cut at {angle:g} degrees": grown(points, angle, device)[1] for angle in ANGLES}
    away = {
        f"formula {1e3 * FIELD:g} mm from the tip at {angle:g} degrees": away_from_tip(angle, FIELD) for angle in ANGLES
    }
    return {**turned, **seen, **away}


def largest_tangential_stress(angle: float) -> float:
    """Direction of the largest tangential stress at the tip of an inclined crack in tension [degrees].

    Its stress intensities have the ratio K_II / K_I = tan(angle).
    """
    ratio = np.tan(np.deg2rad(angle))
    return float(2.0 * np.rad2deg(np.arctan(((1.0 + 8.0 * ratio**2) ** 0.5 - 1.0) / (4.0 * ratio))))


def away_from_tip(angle: float, distance: float) -> float:
    """The same at a distance from the tip [m], where the stress along the crack counts (Williams and Ewing 1972).

    In a tension of one, K_I = cos(angle)^2 (pi HALF)^0.5, K_II = K_I tan(angle), and T = -cos(2 angle) along the crack.
    """
    x, turn = np.deg2rad(angle), np.deg2rad(np.linspace(0.0, 120.0, 12001))
    singular = np.cos(x) * np.cos(0.5 * turn) * (np.cos(x) * np.cos(0.5 * turn) ** 2 + 1.5 * np.sin(x) * np.sin(turn))
    stress = (HALF / (2.0 * distance)) ** 0.5 * singular - np.cos(2.0 * x) * np.sin(turn) ** 2
    return float(np.rad2deg(turn[np.argmax(stress)]))


def intensity(angle: float) -> float:
    """Intensity of the largest tangential stress over that of a crack across the load."""
    half = np.deg2rad(0.5 * largest_tangential_stress(angle))
    opening, sliding = np.cos(np.deg2rad(angle)) ** 2, np.sin(np.deg2rad(2.0 * angle)) / 2.0
    return float(np.cos(half) ** 2 * (opening * np.cos(half) + 3.0 * sliding * np.sin(half)))


def passed(
    points: int,
    device: str | None,
    high: float = HIGH,
    length: float = 0.1 * OFFSET,
    overloaded: bool = False,
) -> Sequence[float]:
    """Length over width of the piece that two cracks cut out: along the notches, and along its own axes.

    Args:
        points: Across the sheet.
        device: Where it runs.
        high: Length of the sheet along the load [m].
        length: Of the damage field [m].
        overloaded: Whether the sheet is pulled to the end of STARTS at once.
    """
    size = points, round(points * high / WIDE)
    sheet = Sheet.filled(WIDE, high, thickness=THICKNESS, density=DENSITY, points=size)
    low, up = 0.5 * (high - OFFSET), 0.5 * (high + OFFSET)
    sheet = sheet.cut((-WIDE, low), (NOTCH, low)).cut((WIDE - NOTCH, up), (2.0 * WIDE, up))
    ends = sheet.where(lambda x, y: abs(y - 0.5 * high) > 0.44 * high)
    starts, steps = (STARTS[1:], (1, STEPS[-1])) if overloaded else (STARTS, STEPS)
    travels = [*(start * high for start in starts), 2.1 * OFFSET]
    _, intact = torn(sheet, travels, steps, length, ends, device)
    return aspects(sheet, intact)


def aspects(sheet: Sheet, intact: np.ndarray) -> Sequence[float]:
    """Length over width of the largest loose piece, at rest: along x and y, and along its principal axes.

    NaN if there is none. Half of the torn row of faces on either side belongs to the piece.
    """
    label = joined_points(sheet.size, sheet.triangles[intact])
    loose = ~np.isin(label, label[np.concatenate([sheet.edges("top"), sheet.edges("bottom")])])
    if not loose.any():
        return [float("nan")] * 2
    piece = sheet.points[label == np.bincount(label[loose]).argmax(), :2]
    if min(np.ptp(piece, axis=0)) < 3.0 * sheet.spacing:
        return [float("nan")] * 2
    centred = piece - piece.mean(axis=0)
    across, along = (centred @ np.linalg.eigh(centred.T @ centred)[1]).T
    lengths = [np.ptp(places) + sheet.spacing for places in (*piece.T, along, across)]
    return [float(lengths[0] / lengths[1]), float(lengths[2] / lengths[3])]


def other_conditions(points: int, device: str | None) -> Mapping[str, float]:
    """Along the notches: from an overloaded start; with a damage field of a fifth of the offset."""
    return {
        "along the notches from an overloaded start": passed(points, device, overloaded=True)[0],
        "with a damage field of a fifth of the offset": passed(points // 2 + 1, device, length=0.2 * OFFSET)[0],
    }


ROWS: tuple[Callable[[], Comparison], ...] = (
    lambda: Comparison(
        "kink",
        ANGLES,
        tuple(map(largest_tangential_stress, ANGLES)),
        WIDE,
        (101,),
        (101, 143, 203),
        kinks,
        what_moves_kinks,
    ),
    lambda: Comparison(
        "lens",
        ("along the notches", "along its own axes"),
        (2.0, 2.0),
        WIDE,
        (73,),
        (73, 103),
        passed,
        other_conditions,
    ),
)
