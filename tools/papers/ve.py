"""VE: Huang, Oterkus and others, 2019."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from study import picture

from papers.rows import Example, Row, Values, run_scene, scene_values, where_passed
from warp_pd import Prony, Visco, Yeoh
from warp_pd.fitting import Curve, Fit, RateTests, fit
from warp_pd.fitting import rate_stress as stress_at_rate
from warp_pd.papers.analytic_response import published_stress

POLYUREA = Yeoh(c10=0.1996e6, c20=0.0170e6)
TERM = Prony(c10=0.01733e6, c20=0.0015e6, time=0.9466, exponent=1.6665)
YOUNG, POISSON, SPACINGS = 1.1976e6, 0.5, 3.015
DAMPING_RUBBER = Yeoh(c10=0.1438e6, c20=0.1438e6)
DAMPING_TERM = Prony(c10=0.0587e6, c20=0.0562e6, time=0.8673, exponent=0.1)
# Material, Prony term and rates of the tests [1/s]: tables 1 and 2, figures 2 and 3.
RUBBERS = {
    "high-damping rubber": (DAMPING_RUBBER, DAMPING_TERM, 0.24, 0.88),
    "polyurea": (POLYUREA, TERM, 0.15, 14.0),
}
# Stretches of the tests that are tabulated; both tests compress.
COMPRESSED = (0.75, 0.5)
SHEET = (1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
RUNNING, VISCOUS = (0.022, 0.023, 0.024, 0.025), (0.025, 0.029, 0.030, 0.031)


def family() -> tuple[np.ndarray, np.ndarray]:
    """The bonds of a whole family: extent along x and length, in spacings."""
    x, y = np.meshgrid(*[np.arange(-3.0, 4.0)] * 2)
    length = np.hypot(x, y)
    inside = (length > 0.0) & (length <= SPACINGS)
    return x[inside], length[inside]


def elastic_stress(stretch: float) -> float:
    """Virial stress of the elastic sheet, eq. 79 [Pa]."""
    x, length = family()
    constant = 12.0 * YOUNG / ((1.0 + POISSON) * math.pi * SPACINGS**3)
    return float(constant * (stretch - 1.0) * (x**2 / length).sum())


def hyperelastic_stress(stretch: float) -> float:
    """Virial stress of the hyperelastic sheet, eq. 74 [Pa]."""
    return float(published_stress(POLYUREA, (), np.array([0.0, 1.0]), np.array([1.0, stretch]))[-1])


def viscous_stress(stretch: float, duration: float) -> float:
    """Part of the Prony term in the stress after a ramp, eq. 62 [Pa]."""
    times, path = np.linspace(0.0, duration, 2000), np.linspace(1.0, stretch, 2000)
    return float(published_stress(POLYUREA, (TERM,), times, path)[-1]) - hyperelastic_stress(stretch)


def equations(_device: str | None) -> Values:
    """What follows from the printed equations alone."""
    found: Values = {"young": 6.0 * POLYUREA.c10}
    # Bonds whose middle third crosses a unit of the line between two rows, from one side.
    found["crossing"] = int(sum(abs(x) for x, _ in zip(*family(), strict=True)) / 2)
    for s in (1.5, 4.0):
        found[f"hyperelastic minus elastic at {s:g}"] = hyperelastic_stress(s) - elastic_stress(s)
    for s in (1.25, 2.5):
        found[f"ramp at {s:g}"] = -viscous_stress(s, (s - 1.0) / 0.15)
        found[f"jump at {s:g}"] = -viscous_stress(s, 2.5e-6)
    return found


def rate_stress(rubber: Yeoh, term: Prony, rate: float, stretch: np.ndarray, sign: float = -1.0) -> np.ndarray:
    """Cauchy stress in a uniaxial test at a constant rate [Pa], eqs. 30 and 33; rate 0 is equilibrium.

    `sign` of the exponent of the rate in the relaxation time is -1 as printed.
    """

    def spring(c10: float, c20: float, s: np.ndarray) -> np.ndarray:
        return 2.0 * (s**2 - 1.0 / s) * (c10 + 2.0 * c20 * (s**2 + 2.0 / s - 3.0))

    total = spring(rubber.c10, rubber.c20, stretch)
    for n, goal in enumerate(stretch if rate > 0.0 else ()):
        edges = np.linspace(1.0, goal, 2001)
        middle = 0.5 * (edges[1:] + edges[:-1])
        relaxation = term.time * (rate * np.sqrt(4.0 * middle**2 + 2.0 * middle**-4)) ** (sign * term.exponent)
        kept = np.exp(-np.abs(goal - middle) / (rate * relaxation))
        total[n] += (np.diff(spring(term.c10, term.c20, edges)) * kept).sum()
    return total


def law(c10: float, c20: float, v10: float, v20: float, time: float, exponent: float) -> Visco:
    """A rubber with one Prony term."""
    return Visco(Yeoh(c10, c20), prony=[Prony(v10, v20, time, exponent)])


def identified(rates: tuple[float, ...]) -> Fit:
    """The constants of table 1, found again from curves that they give at these rates, from another start."""
    true = {"c10": 0.1438e6, "c20": 0.1438e6, "v10": 0.0587e6, "v20": 0.0562e6, "time": 0.8673, "exponent": 0.1}
    stretch = np.linspace(0.95, 0.4, 12)
    tests = [
        Curve("uniaxial", stretch, "stress", stress_at_rate(law(**true), "uniaxial", r, stretch), name=f"{r:g} /s")
        for r in rates
    ]
    start = {"c10": 1e5, "c20": 1e5, "v10": 1e5, "v20": 1e4, "time": 1.0, "exponent": 0.3}
    return fit(RateTests(law, tests, rates=rates), list(true), start=start)


def rates(_device: str | None) -> Values:
    """VE 2.2 and 2.3: whether stress rises with the rate, and whether the printed tests tell the constants."""
    found: Values = {}
    for name, (rubber, term, slow, fast) in RUBBERS.items():
        for s in COMPRESSED:
            at = np.array([s])
            for rate in (slow, fast):
                found[f"{name} {rate:g} at {s:g}"] = rate_stress(rubber, term, rate, at)[0]
            high, low = found[f"{name} {fast:g} at {s:g}"], found[f"{name} {slow:g} at {s:g}"]
            found[f"{name}, fast over slow at {s:g}"] = high / low
            other = [rate_stress(rubber, term, rate, at, sign=1.0)[0] for rate in (slow, fast)]
            found[f"{name}, other sign at {s:g}"] = other[1] / other[0]
            found[f"{name}, faster at {s:g}"] = rate_stress(rubber, term, 10.0 * fast, at)[0] / high
            spring = rate_stress(rubber, term, 0.0, at)[0]
            found[f"{name}, viscous share at {s:g}"] = 1.0 - spring / low
            found[f"{name}, viscous share, other sign at {s:g}"] = 1.0 - spring / other[0]
            own = [stress_at_rate(Visco(rubber, prony=[term]), "uniaxial", r, at)[0] * s for r in (slow, fast)]
            found[f"{name}, Visco off eq. 30 at {s:g}"] = max(abs(own[0] / low - 1.0), abs(own[1] / high - 1.0))
    for name, used in (("three", (0.0, 0.24, 0.88)), ("two", (0.0, 0.24))):
        result = identified(used)
        found[f"{name} rates, error"] = abs(result.estimates["exponent"] / 0.1 - 1.0)
        found[f"{name} rates, notes"] = "; ".join(result.notes)
    return found


def run_at_rate(name: str, rate: float, stretch: float, device: str | None) -> Values:
    """A sheet of one of the rubbers in a test at a constant rate: scene `rate_test`."""
    rubber, term, *_ = RUBBERS[name]
    return scene_values(
        "rate_test", device, rate=rate, stretch=stretch, c10=rubber.c10, c20=rubber.c20, prony_c10=term.c10,
        prony_c20=term.c20, prony_time=term.time, prony_exponent=term.exponent,
    )  # fmt: skip


def rate_picture(path: Path) -> None:
    """Figures 2 and 3 from the printed constants."""
    with picture(path, columns=2) as axes:
        for axis, (name, (rubber, term, *between)) in zip(axes[0], RUBBERS.items(), strict=True):
            stretch = np.concatenate([np.linspace(0.4, 0.99, 60), np.linspace(1.01, 2.5, 60)])
            for rate in (0.0, *between):
                label = "equilibrium" if rate == 0.0 else f"{rate:g} /s"
                axis.plot(stretch, rate_stress(rubber, term, rate, stretch) / 1e6, label=label)
            axis.set(title=name, xlabel="stretch", ylabel="Cauchy stress (MPa)", ylim=(-4.0, 4.0))
            axis.legend()


def failing(scene: str, times: tuple[float, ...], device: str | None, **settings: Any) -> Values:
    """A crack that runs: damage at the paper's times."""
    found, result = run_scene(scene, device, failure=True, **settings)
    return found | where_passed(result, "time", times, ("mean_damage", "largest_damage"))


def opened(stretch: float, device: str | None, **settings: Any) -> Values:
    """A crack that does not run."""
    return scene_values("visco_crack", device, stretch=stretch, load_steps=20, **settings)


FREE = {"law": "stress_free"}
MEANT = {"energy": 6.69e6}
MICROSECONDS = (150e-6, 170e-6, 180e-6, 190e-6)
EXAMPLES: dict[str, Example] = {
    "ve.2.3": rates,
    **{
        f"ve.2.2.{rate:g}": partial(run_at_rate, name, rate, 0.5)
        for name, (_, _, *both) in RUBBERS.items()
        for rate in both
    },
    "ve.equations": equations,
    # Short ramps need less inertia than that of the scene's exaggerated density.
    **{
        f"ve.6.1.{s:g}": partial(scene_values, "visco_sheet", viscous=False, stretch=s, density=2e5 if s < 3.0 else 2e6)
        for s in SHEET
    },
    **{f"ve.6.2.{s:g}": partial(scene_values, "visco_hole", stretch=s) for s in (4.0, 7.0)},
    **{
        f"ve.6.2.{s:g}.circle": partial(scene_values, "visco_hole", stretch=s, load_steps=24, **FREE)
        for s in (4.0, 7.0)
    },
    **{f"ve.6.3.{s:g}": partial(opened, s) for s in (1.5, 4.0)},
    **{f"ve.6.3.{s:g}.free": partial(opened, s, **FREE) for s in (1.5, 4.0)},
    "ve.6.3.runs": partial(failing, "visco_crack", RUNNING),
    "ve.6.3.runs.meant": partial(failing, "visco_crack", RUNNING, **MEANT),
    **{
        f"ve.6.3.runs.{points}": partial(failing, "visco_crack", RUNNING, points=points, **MEANT)
        for points in (40, 60, 140, 200)
    },
    "ve.6.3.runs.free": partial(failing, "visco_crack", RUNNING, **MEANT, **FREE),
    "ve.6.4": partial(scene_values, "metamaterial"),
    "ve.6.4.crack": partial(scene_values, "metamaterial", crack=True),
    "ve.6.4.runs": partial(failing, "metamaterial", MICROSECONDS),
    "ve.6.5": partial(scene_values, "visco_sheet"),
    **{f"ve.6.6.{s:g}": partial(scene_values, "visco_hole", viscous=True, stretch=s) for s in (2.5, 3.0)},
    **{f"ve.6.7.{s:g}": partial(opened, s, viscous=True) for s in (1.5, 2.5)},
    "ve.6.7.runs.meant": partial(failing, "visco_crack", VISCOUS, viscous=True, **MEANT),
    "ve.6.8": partial(scene_values, "metamaterial", viscous=True),
    "ve.6.8.crack": partial(scene_values, "metamaterial", viscous=True, crack=True),
    "ve.6.8.runs": partial(failing, "metamaterial", MICROSECONDS, viscous=True),
}  # fmt: skip

ROWS = [
    *(
        Row("ve.2.3", f"2.3, figure {figure}", f"{name}, Cauchy stress at {s:g} of its length, {rate:g} /s (MPa)",
            "a curve", f"{name} {rate:g} at {s:g}", "eqs. 30 and 33, printed constants", scale=1e-6)
        for figure, (name, (_, _, *both)) in zip((2, 3), RUBBERS.items(), strict=True)
        for rate in both
        for s in COMPRESSED
    ),
    *(
        Row("ve.2.3", f"2.3, figure {figure}",
            f"{name} at {s:g} of its length: stress at {fast:g} /s over that at {slow:g} /s", "above 1",
             f"{name}, {what} at {s:g}", reading, low=1.0)
        for figure, (name, (_, _, slow, fast)) in zip((2, 3), RUBBERS.items(), strict=True)
        for what, reading in (
            ("fast over slow", "eqs. 30 and 33, printed constants"),
            ("other sign", "relaxation time that rises with the rate, eq. 19 with +eta"),
        )
        for s in COMPRESSED
    ),
    *(
        Row("ve.2.3", "2.3", f"high-damping rubber at {s:g} of its length: stress at 8.8 /s over that at 0.88 /s",
            "no significant change", f"high-damping rubber, faster at {s:g}", "eqs. 30 and 33, within 5 %",
            low=0.95, high=1.05)
        for s in COMPRESSED
    ),
    *(
        Row("ve.2.3", "2.3", f"polyurea at {s:g} of its length: relaxing part of the stress at 0.15 /s (%)",
            "none: this test gave spring A", f"polyurea, {what} at {s:g}", reading, low=-0.02, high=0.02, scale=100.0)
        for what, reading in (
            ("viscous share", "eqs. 30 and 33, within 2 %"),
            ("viscous share, other sign", "relaxation time that rises with the rate, within 2 %"),
        )
        for s in COMPRESSED
    ),
    *(
        Row("ve.2.3", "2.2, eq. 30", f"{name} at {s:g} of its length: law Visco off eq. 30 at both rates (%)", "-",
            f"{name}, Visco off eq. 30 at {s:g}", "its second Piola stress relaxes, not the Cauchy stress", scale=100.0)
        for name in RUBBERS
        for s in COMPRESSED
    ),
    *(
        Row(f"ve.2.2.{rate:g}", "2.2", f"{name}: sheet at {rate:g} /s off the exact stress (%)",
            "-", "nominal_stress, error", "scene rate_test, law Visco", low=-1e-3, high=1e-3, scale=100.0)
        for name, (_, _, *both) in RUBBERS.items()
        for rate in both
    ),
    Row("ve.2.3", "2.3, table 1", "eta found again from curves at 0, 0.24 and 0.88 /s, off by (%)", "-",
        "three rates, error", "curves of table 1", high=0.01, scale=100.0),
    Row("ve.2.3", "2.3, table 1", "eta found again from curves at 0 and 0.24 /s, off by (%)", "identified",
        "two rates, error", "the tests that the paper used", high=0.01, scale=100.0),
    Row("ve.equations", "6", "Young's modulus of polyurea, 6 c10 (MPa)", "1.1976", "young", value=1.1976e6, scale=1e-6),
    Row("ve.equations", "4, eq. 67", "bonds across a unit of the crack, in spacings", "36", "crossing",
        "each bond once", value=36.0),
    *(
        Row(f"ve.6.1.{s:g}", "6.1, figure 6", f"displacement at {s:g} off uniform stretch (%)", "as ANSYS",
            "displacement_at_point, error", low=-1e-3, high=1e-3, scale=100.0)
        for s in SHEET
    ),
    *(
        Row("ve.equations", "6.1, figure 7", f"hyperelastic minus elastic stress at {s:g} (MPa)", text,
            f"hyperelastic minus elastic at {s:g}", "eqs. 74, 78 and 79", value=value, scale=1e-6)
        for s, text, value in ((1.5, "0.31", 0.31e6), (4.0, "9.12", 9.12e6))
    ),
    *(
        Row(f"ve.6.2.{s:g}{run}", f"6.2, figure {figure}", f"squareness of the hole at {s:g} (%)", "circular",
            "squareness", reading, low=-0.01, high=0.01, scale=100.0)
        for s, figure in ((4.0, 9), (7.0, 10))
        for run, reading in (("", "a staircase of cells"), (".circle", "stress-free law, points on the circle"))
    ),
    *(
        Row(f"ve.6.3.{s:g}{run}", f"6.3, figure {figure}", f"{what} at {s:g} off elements (%)", "as ANSYS",
            f"{name}, error", reading + where, low=-0.05, high=0.05, scale=100.0)
        for s, figure in ((1.5, 12), (4.0, 13))
        for run, reading in (("", "published law"), (".free", "stress-free law"))
        for what, name, where in (
            ("stress", "nominal_stress", ""),
            ("opening", "crack_opening", ", half a spacing beside the crack"),
        )
    ),
    Row("ve.6.3.runs", "6.3, figure 14", "damage begins (ms)", "at 22", "damage_begins", "Gc = 6.69 N/m as printed",
        value=0.022, within=0.05, scale=1e3),
    Row("ve.6.3.runs.meant", "6.3, figure 14", "damage begins (ms)", "at 22", "damage_begins",
        "Gc = 6.69 MN/m, as moduli in MPa", value=0.022, within=0.05, scale=1e3),
    *(
        Row(f"ve.6.3.runs.{points}", "6.3, figure 14", f"damage begins (ms), {points} points", "at 22", "damage_begins",
            "Gc = 6.69 MN/m", value=0.022, within=0.05, scale=1e3)
        for points in (40, 60, 140, 200)
    ),
    Row("ve.6.3.runs.free", "6.3, figure 14", "damage begins (ms)", "at 22", "damage_begins",
        "the same, stress-free law", value=0.022, within=0.05, scale=1e3),
    *(
        Row("ve.6.3.runs.meant", "6.3, figure 14", f"mean damage at {time * 1e3:g} ms (%)", "a picture",
            f"mean_damage at {time:g}", "Gc = 6.69 MN/m", scale=100.0)
        for time in RUNNING
    ),
    Row("ve.6.4", "6.4, figure 16", "side inclusions move (m)", "a picture", "side_inclusion_moves"),
    Row("ve.6.4.crack", "6.4, figure 17", "side inclusions move (m)", "a picture", "side_inclusion_moves"),
    *(
        Row(run, f"{section}, figure {figure}", f"damage at {time * 1e6:g} microseconds (%)", "a picture",
            f"mean_damage at {time:g}", "1 per microsecond, as printed", scale=100.0)
        for run, section, figure in (("ve.6.4.runs", "6.4", 18), ("ve.6.8.runs", "6.8", 28))
        for time in MICROSECONDS
    ),
    Row("ve.6.5", "6.5, figure 19", "stress at 2.5 off the exact convolution of eq. 62 (%)", "a curve",
        "nominal_stress, error", "0.15 /s", low=-1e-3, high=1e-3, scale=100.0),
    *(
        Row("ve.equations", "6.5, figure 19", f"hyperelastic minus visco-hyperelastic stress at {s:g} (kPa)", text,
            f"{name} at {s:g}", reading, value=value, scale=1e-3)
        for s, text, value in ((1.25, "24", 0.24e5), (2.5, "1200", 1.2e6))
        for name, reading in (("ramp", "a ramp at 0.15 /s"), ("jump", "stretched within 2.5 microseconds"))
    ),
    *(
        Row(f"ve.6.6.{s:g}", f"6.6, figure {figure}", f"squareness of the hole at {s:g} (%)", "circular", "squareness",
            "a staircase of cells", low=-0.01, high=0.01, scale=100.0)
        for s, figure in ((2.5, 20), (3.0, 21))
    ),
    *(
        Row(f"ve.6.7.{s:g}", f"6.7, figure {figure}", f"opening of the crack at {s:g} (m)", "as ANSYS",
            "crack_opening", "0.15 /s")
        for s, figure in ((1.5, 22), (2.5, 23))
    ),
    Row("ve.6.7.runs.meant", "6.7, figure 24", "damage begins (ms)", "at 25", "damage_begins", "Gc = 6.69 MN/m",
        value=0.025, within=0.05, scale=1e3),
    *(
        Row("ve.6.7.runs.meant", "6.7, figure 24", f"mean damage at {time * 1e3:g} ms (%)", "a picture",
            f"mean_damage at {time:g}", "Gc = 6.69 MN/m", scale=100.0)
        for time in VISCOUS
    ),
    Row("ve.6.8", "6.8, figure 26", "side inclusions move (m)", "as ANSYS", "side_inclusion_moves", "0.15 /s"),
    Row("ve.6.8.crack", "6.8, figure 27", "opening of the crack at 1.2 (m)", "as ANSYS", "crack_opening", "0.15 /s"),
]  # fmt: skip
