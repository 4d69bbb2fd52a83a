"""Error against run time: all force laws, horizons, spacings, precisions and solvers, against finite elements.

    python tools/error_vs_time.py                              # this CPU; takes long, see --points
    python tools/error_vs_time.py --fast                       # a minute: a few small cases
    python tools/error_vs_time.py --device cuda:0 --scenes pressure tension --repeats 3

Time is that of a whole run without files, set-up included, compilation not: the median of repeated runs. Point-steps
are points times force evaluations (steps of a march, products of Newton's method). Every call adds or replaces rows
in the device's file in docs/error-vs-time/ and makes docs/error-vs-time.md and its pictures anew from all files; with
--numbers elsewhere it prints the front alone.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import stretch
from stamp import device_name, stamp

from warp_pd import Bimodular, BondAssociated, BondBased, Explicit, Newton, Relaxation, Simulation
from warp_pd.checks import InputError
from warp_pd.cli import build_scene
from warp_pd.forces import ForceLaw, force_law
from warp_pd.frame import Frame
from warp_pd.runner import DivergedError, Result, write_aside
from warp_pd.device.context import find_device

ROOT = Path(__file__).resolve().parents[1]
DATA, DOCS = ROOT / "tests/validation/data", ROOT / "docs"
PAGE, FOLDER = DOCS / "error-vs-time.md", DOCS / "error-vs-time"
Array = npt.NDArray[np.float64]
History = list[dict[str, float]]

WEIGHTS = ("published", "plain", "corrected")
# The publications' own choice, which the page compares with.
PUBLISHED = {"law": "published", "horizon": 3.15, "points": 101}
STRETCH_LAWS = {"bonds": {"force": "bond_based"}, "bonds refitted": {"force": "bond_based_refitted"}}
TARGETS = (0.03, 0.01, 0.003, 0.001)
# Beyond so many times the limit the next finer sheet is not tried.
GROWTH = 6.0


@dataclass(frozen=True)
class Case:
    """One run; `points` along a side, `horizon` over the spacing, `precision` in bits."""

    scene: str
    law: str
    horizon: float
    points: int
    precision: int
    solver: str


@dataclass(frozen=True)
class Row:
    """What a case gave: errors are relative, None where the run failed; times in seconds."""

    case: Case
    status: str
    scalar: float | None
    field: float | None
    seconds: float
    spread: float
    setup: float
    compile: float
    point_steps: float
    device: str
    stand: str


@dataclass(frozen=True)
class Study:
    """A scene and what its runs are compared with.

    Attributes:
        scene: Its name.
        about: What is measured, and how well the reference knows it.
        laws: Laws that apply.
        solvers: Solvers that apply.
        settings: Of the scene, besides points and horizon.
        errors: Result and collected frames -> relative error of a scalar, and L2 of the displacement field.
        times: Frames to collect [s].
        own: Case that is the reference itself, twice as fine, where there are no finite elements.
    """

    scene: str
    about: str
    laws: tuple[str, ...]
    solvers: tuple[str, ...]
    settings: dict[str, Any]
    errors: Callable[[Result, dict[float, Frame], History], tuple[float, float]]
    times: tuple[float, ...] = ()
    own: Case | None = None


class Collector:
    """Keeps the frames at some times."""

    def __init__(self, times: Sequence[float]) -> None:
        self.times = times
        self.frames: dict[float, Frame] = {}

    def write(self, frame: Frame) -> None:
        """Keep it if it is one of those asked for."""
        for time in self.times:
            if abs(frame.time - time) < 1e-6:
                self.frames[time] = frame

    def save(self) -> None:
        """Nothing to bring to a disk."""

    def close(self) -> None:
        """The run is over."""


def interpolated(nodes: Array, displacement: Array, points: Array) -> Array:
    """A finite-element field at points of its quarter or half: by a spline on a grid, by piecewise cubics elsewhere."""
    from scipy.interpolate import CloughTocher2DInterpolator, RectBivariateSpline

    low, high = nodes.min(axis=0), nodes.max(axis=0)
    # Points of the edge may lie a rounding error outside.
    points = np.clip(points, low, high)
    x, y = (np.unique(nodes[:, c].round(9)) for c in (0, 1))
    if len(x) * len(y) != len(nodes):
        return CloughTocher2DInterpolator(nodes, displacement, rescale=True)(points)
    order = np.lexsort((nodes[:, 1].round(9), nodes[:, 0].round(9)))
    values = displacement[order].reshape(len(x), len(y), -1)
    splines = [RectBivariateSpline(x, y, values[..., c]) for c in range(values.shape[2])]
    return np.column_stack([spline.ev(points[:, 0], points[:, 1]) for spline in splines])


def field_error(sheet: Any, found: Array, reference: Array) -> float:
    """Relative L2 norm of the difference of two displacement fields, areas as weights."""
    here = np.isfinite(reference).all(axis=1)
    a = sheet.areas[here, None]
    return float(np.sqrt((a * (found - reference)[here] ** 2).sum() / (a * reference[here] ** 2).sum()))


def quarter_field(nodes: Array, displacement: Array, points: Array, centre: tuple[float, float]) -> Array:
    """A field known on the quarter x, y >= 0 about `centre`, at all points: in-plane parts change sign with x and y."""
    offset = points - np.array(centre)
    field = interpolated(nodes, displacement, np.abs(offset))
    field[:, :2] *= np.where(offset < 0.0, -1.0, 1.0)
    return field


def pressure_errors(result: Result, frames: dict[float, Frame], own: History) -> tuple[float, float]:
    """Deflection of the centre; the field."""
    data = np.load(DATA / "pressure.npz")
    sheet = result.built.simulation.sheet
    moved = data["x"] - np.column_stack([data["X"], np.zeros(len(data["X"]))])
    reference = quarter_field(data["X"], moved, sheet.points, (0.05, 0.05))
    scalar = result.summary["measures"]["center_deflection"]["error"]
    return scalar, field_error(sheet, result.frame.displacement, reference)


def tension_errors(result: Result, frames: dict[float, Frame], own: History) -> tuple[float, float]:
    """Contraction of the free edge; the field."""
    data = np.load(DATA / "tension.npz")
    sheet = result.built.simulation.sheet
    offset = sheet.points - np.array([0.0, 0.05])
    field = interpolated(data["X"], data["x"] - data["X"], np.column_stack([offset[:, 0], np.abs(offset[:, 1])]))
    field[:, 1] *= np.where(offset[:, 1] < 0.0, -1.0, 1.0)
    scalar = result.summary["measures"]["edge_contraction"]["error"]
    return scalar, field_error(sheet, result.frame.displacement[:, :2], field)


def dynamic_errors(result: Result, frames: dict[float, Frame], own: History) -> tuple[float, float]:
    """Root mean square over four times, of the largest deflection and of the field."""
    data = np.load(DATA / "pressure_dynamic_20Pa.npz")
    sheet = result.built.simulation.sheet
    nodes = np.column_stack([data["X"], np.zeros(len(data["X"]))])
    scalars, fields = [], []
    for time in (0.25, 0.5, 0.75, 1.0):
        reference = quarter_field(data["X"], data[f"x_t{time}"] - nodes, sheet.points, (0.5, 0.5))
        fields.append(field_error(sheet, frames[time].displacement, reference))
        scalars.append(result.summary["measures"][f"largest_deflection_at_{time:g}_s"]["error"])
    return float(np.sqrt(np.mean(np.square(scalars)))), float(np.sqrt(np.mean(np.square(fields))))


def tear_errors(result: Result, frames: dict[float, Frame], own: History) -> tuple[float, float]:
    """Largest load; load over extension, in L2. References are the run `own`."""
    curves = []
    for history in (result.history, own):
        extension, load = (np.array([row[name] for row in history]) for name in ("extension", "load"))
        curves.append((extension, load))
    (extension, load), (own_extension, own_load) = curves
    at = np.linspace(0.0, min(extension[-1], own_extension[-1]), 400)
    found, reference = np.interp(at, extension, load), np.interp(at, own_extension, own_load)
    field = float(np.linalg.norm(found - reference) / np.linalg.norm(reference))
    return float(load.max() / own_load.max()) - 1.0, field


def hole_errors(result: Result, frames: dict[float, Frame], own: History) -> tuple[float, float]:
    """Force on an edge; the field outside the hole and inside the sheet."""
    nodes, moved = stretch.elements("equibiaxial", 2.0)
    sheet = result.built.simulation.sheet
    field = interpolated(nodes, moved, sheet.points)
    x, y = sheet.points.T
    field[(np.hypot(x, y) < 0.08) | (np.abs(sheet.points) > 0.25 * (1.0 + 1e-9)).any(axis=1)] = np.nan
    scalar = result.summary["measures"]["edge_force"]["error"]
    return scalar, field_error(sheet, result.frame.displacement[:, :2], field)


STUDIES = (
    Study(
        "pressure",
        "Sheet under follower pressure at rest (BA 6.2): deflection of the centre, and the displacement field. "
        "Reference: Q9 membrane, 1e-6. Nodal correspondence finds no rest: its zero-energy modes "
        "([neural law](neural-law.md)).",
        (*WEIGHTS, "closed_form", "bond_based"),
        ("newton", "relaxation", "explicit"),
        {},
        pressure_errors,
    ),
    Study(
        "tension",
        "Sheet pulled to twice its length (BA 6.1): contraction of the free edge, and the displacement field. "
        "Reference: Q9 membrane, 1e-5.",
        (*WEIGHTS, "closed_form", "bond_based"),
        ("newton", "relaxation", "explicit"),
        {},
        tension_errors,
    ),
    Study(
        "pressure_dynamic",
        "Sheet under sudden pressure (NN 6.1): largest deflection and field at 0.25, 0.5, 0.75 and 1 s, root mean "
        "squares. Reference: Q4 membrane, 0.5, 0.5, 1 and 0.2 % at these times: differences below that mean nothing.",
        (*WEIGHTS, "nodal", "closed_form", "neural_fused"),
        ("explicit",),
        {"frames": 4},
        dynamic_errors,
        (0.25, 0.5, 0.75, 1.0),
    ),
    Study(
        "stretch",
        "Incompressible sheet with a hole, all edges moved apart to twice its size (HE chapter 5): force on an edge, "
        "and the displacement field. `bonds` and `bonds refitted` are the bond-based laws made for this mode, with "
        "layers of points outside the sheet. Reference: Q9 membrane, 1e-4. With published weights the sheet found no "
        "rest (26 points: float32 diverges, float64 not converged in 150 s).",
        ("plain", "corrected", "bonds", "bonds refitted"),
        ("newton", "relaxation"),
        {"stretch": 2.0, "defect": "hole"},
        hole_errors,
    ),
    Study(
        "double_notch",
        "Sheet torn between two notches (BA 6.3): largest load, and the curve of load over extension in L2 (in "
        "the place of a field). Reference: plain weights, 3.15, float32, twice as fine as the finest row; a critical "
        "stretch is no fracture energy, so the load itself falls with the spacing, and no order is to be expected.",
        ("published", "plain"),
        ("explicit",),
        {"duration": 1.8, "frames": 180},
        tear_errors,
        own=Case("double_notch", "plain", 3.15, 0, 32, "explicit"),
    ),
)


def law_of(name: str, simulation: Simulation, horizon: float) -> ForceLaw:
    """The law of a name with the material of the scene; bond-based sheets are linear, with E = 3 mu."""
    material: Any = simulation.force.material
    if name in WEIGHTS:
        return BondAssociated(material, horizon=horizon, weights=name)
    if name == "bond_based":
        return BondBased(Bimodular(3.0 * material.mu), horizon=horizon)
    return force_law(name, material, horizon)


def simulation_of(study: Study, case: Case) -> Simulation:
    """The scene with the law, the solver and nothing that the comparison does not need."""
    settings = {**study.settings, "points": case.points, "horizon": case.horizon}
    solvers = {"newton": Newton, "relaxation": Relaxation, "explicit": Explicit}
    if len(study.solvers) > 1:
        settings["solver"] = case.solver
    if case.scene == "stretch":
        settings |= STRETCH_LAWS.get(case.law, {"force": "bond_associated", "weights": case.law})
        return dataclasses.replace(build_scene(case.scene, settings), track_energy=False)
    simulation = build_scene(case.scene, settings)
    assert isinstance(simulation.solver, solvers[case.solver])
    return dataclasses.replace(simulation, force=law_of(case.law, simulation, case.horizon), track_energy=False)


def applies(study: Study, case: Case) -> bool:
    """Whether the law and the solver go together."""
    if case.solver == "newton":
        # Wider horizons have no multigrid, see docs/solvers.md.
        return case.precision == 64 and case.horizon < 2.5 and case.law in ("plain", "corrected", "bond_based")
    if study.own is not None:
        return case.precision == 32 and 2.0 < case.horizon < 4.0
    if case.solver == "explicit" and len(study.solvers) > 1:
        # Damped to rest in time, which is what relaxation does better: one horizon shows by how much.
        return case.horizon == 2.015 and case.law in WEIGHTS
    return True


def cases(study: Study, horizons: Sequence[float], precisions: Sequence[int]) -> Iterator[Case]:
    """All cases of a study but for the spacing, which is 0."""
    for law, solver, precision, horizon in itertools.product(study.laws, study.solvers, precisions, horizons):
        case = Case(study.scene, law, horizon, 0, precision, solver)
        if applies(study, case):
            yield case


def measure(study: Study, case: Case, device: str, repeats: int, enough: float, stand: str, own: History) -> Row:
    """Run a case, again up to `repeats` times unless that takes more than `enough` seconds."""
    times: list[float] = []
    compiling = 0.0
    while len(times) < repeats and sum(times) < enough:
        collector = Collector(study.times)
        result = simulation_of(study, case).run(device=device, precision=case.precision, writers=[collector])
        summary = result.summary
        times.append(summary["wall_s"] - summary["compile_s"])
        compiling = max(compiling, summary["compile_s"])
    scalar = field = None
    if result.status == "finished":
        scalar, field = study.errors(result, collector.frames, own)
    evaluations: int = summary["steps"]
    if case.solver == "newton":
        evaluations: int = summary["solve"].get("products", 0) + summary["solve"]["iterations"]
    median = statistics.median(times)
    return Row(
        case=case,
        status=result.status,
        scalar=scalar,
        field=field,
        seconds=median,
        spread=(max(times) - min(times)) / median,
        setup=summary["setup_s"],
        compile=compiling,
        point_steps=float(summary["points"]) * float(evaluations),
        device=summary["device"],
        stand=stand,
    )


def sweep(study: Study, options: argparse.Namespace, device: str, stand: str) -> list[Row]:
    """Every case from coarse to fine, until the next one would pass the limit; saved ladder by ladder."""
    found: list[Row] = []
    known = (
        {row.case for row in load(options.numbers) if row.device == find_device(device).name}
        if options.missing
        else set()
    )
    own: History = []
    if study.own is not None:
        finest = 2 * max(options.tear_points)
        fine = dataclasses.replace(study.own, points=finest)
        own = simulation_of(study, fine).run(device=device, precision=fine.precision).history
        stand += f", reference {finest} points"
    for case in cases(study, options.horizon, options.precision):
        if options.laws and case.law not in options.laws:
            continue
        rows: list[Row] = []
        for points in sorted(options.points if study.own is None else options.tear_points):
            fine = dataclasses.replace(case, points=points)
            if fine in known:
                continue
            try:
                row = measure(study, fine, device, options.repeats, options.enough, stand, own)
            except (InputError, DivergedError) as error:
                row = Row(fine, str(error), None, None, 0.0, 0.0, 0.0, 0.0, 0.0, device, stand)
            if row.status == "interrupted":
                sys.exit("interrupted; what was saved before is kept, --missing goes on")
            rows.append(row)
            print(describe(row), flush=True)
            if row.seconds * GROWTH > options.limit:
                break
        save(options.numbers, rows)
        found += rows
    return found


def describe(row: Row) -> str:
    """One line of progress."""
    c = row.case
    errors = f"{100 * row.scalar:+.4f} % {100 * row.field:.4f} %" if row.field is not None else row.status
    return f"{c.scene} {c.law} {c.horizon:g} {c.points} f{c.precision} {c.solver}: {errors} in {row.seconds:.3g} s"


def load(folder: Path) -> list[Row]:
    """Rows of all devices."""
    rows = []
    for path in sorted(folder.glob("*.json")):
        for item in json.loads(path.read_text()):
            rows.append(Row(**{**item, "case": Case(**item["case"])}))
    return rows


def save(folder: Path, rows: Sequence[Row]) -> None:
    """Add or replace rows in the files of their devices."""
    folder.mkdir(parents=True, exist_ok=True)
    known = {(row.device, row.case): row for row in load(folder)} | {(row.device, row.case): row for row in rows}
    for device in {row.device for row in rows}:
        mine = [dataclasses.asdict(row) for (where, _), row in known.items() if where == device]
        name = "".join(c if c.isalnum() else "-" for c in device.lower()).strip("-")
        write_aside(folder / f"{name}.json", json.dumps(mine, indent=1) + "\n")


def good(rows: Sequence[Row]) -> list[Row]:
    """Rows with an error."""
    return [row for row in rows if row.field is not None and np.isfinite(row.field)]


def front(rows: Sequence[Row], error: Callable[[Row], float], cost: Callable[[Row], float]) -> list[Row]:
    """Rows that no other beats in both, by rising cost."""
    best: list[Row] = []
    for row in sorted(good(rows), key=lambda r: (cost(r), error(r))):
        if not best or error(row) < error(best[-1]):
            best.append(row)
    return best


def field_of(row: Row) -> float:
    """Error of the field."""
    assert row.field is not None
    return row.field


def scalar_of(row: Row) -> float:
    """Size of the error of the scalar."""
    assert row.scalar is not None
    return abs(row.scalar)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Work-precision diagrams of one scene and device: errors over time and over point-steps, with their fronts."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    figure = Figure(figsize=(15, 5), layout="constrained")
    panels = [
        (scalar_of, "error of the scalar", lambda r: r.seconds, "time of the run (s)"),
        (field_of, "L2 error of the field", lambda r: r.seconds, "time of the run (s)"),
        (field_of, "L2 error of the field", lambda r: r.point_steps, "point-steps"),
    ]
    laws = sorted({law for study in STUDIES for law in study.laws})
    marks = {"newton": "o", "relaxation": "s", "explicit": "^"}
    for axes, (error, ylabel, cost, xlabel) in zip(figure.subplots(1, 3), panels, strict=True):
        for law, (solver, mark) in itertools.product(laws, marks.items()):
            some = [r for r in good(rows) if r.case.law == law and r.case.solver == solver]
            if some:
                axes.scatter(
                    [cost(r) for r in some], [error(r) for r in some], marker=mark, s=22, alpha=0.75,
                    color=f"C{laws.index(law)}", label=f"{law}, {solver}",
                )  # fmt: skip
        best = front(rows, error, cost)
        axes.plot([cost(r) for r in best], [error(r) for r in best], color="black", lw=1, label="front", zorder=0)
        axes.set(xscale="log", yscale="log", xlabel=xlabel, ylabel=ylabel)
        low, high = axes.get_xlim()
        if high > 10.0 * low:
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
    figure.axes[-1].legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, dpi=110)


def name_of(case: Case) -> str:
    """A case in words, without its scene."""
    return f"{case.law}, {case.horizon:g}, {case.points} points, {case.solver}, float{case.precision}"


def front_table(rows: Sequence[Row]) -> list[str]:
    """The front of field error over time."""
    lines = ["| fastest up to this error | field | scalar | time s | point-steps |", "|---|---|---|---|---|"]
    for row in front(rows, field_of, lambda r: r.seconds):
        lines.append(
            f"| {name_of(row.case)} | {100 * field_of(row):.3g} % | {100 * (row.scalar or 0.0):+.3g} % | "
            f"{row.seconds:.3g} | {row.point_steps:.2g} |"
        )
    return lines


def published_text(rows: Sequence[Row]) -> str:
    """By how much the published settings are beaten, at equal time and at equal error."""
    mine = [r for r in good(rows) if all(getattr(r.case, k) == v for k, v in PUBLISHED.items())]
    if not mine:
        return (
            "No answer of the published settings (published weights, horizon 3.15, 101 points) is among the runs here: "
            "they diverge or were left out, as the scene's text, the list below or the limit of time have it."
        )
    row = min(mine, key=lambda r: r.seconds)
    in_time = min((r for r in good(rows) if r.seconds <= row.seconds), key=field_of)
    as_good = min((r for r in good(rows) if field_of(r) <= field_of(row)), key=lambda r: r.seconds)
    return (
        f"The published settings (published weights, horizon 3.15, 101 points; {row.case.solver}, "
        f"float{row.case.precision}) leave a field error of {100 * field_of(row):.3g} % in {row.seconds:.3g} s. In no "
        f"more time, {name_of(in_time.case)} leaves {100 * field_of(in_time):.3g} %, "
        f"{field_of(row) / field_of(in_time):.3g} times less; no worse an error takes {name_of(as_good.case)} "
        f"{as_good.seconds:.3g} s, {row.seconds / as_good.seconds:.3g} times less."
    )


def orders(rows: Sequence[Row]) -> list[str]:
    """Observed orders in the spacing, field error, the most precise runs of each law and horizon."""
    lines = ["| law | horizon | points: field error | orders |", "|---|---|---|---|"]
    groups: dict[tuple[str, float], dict[int, Row]] = {}
    for row in sorted(good(rows), key=lambda r: (r.case.precision, r.case.solver != "newton")):
        groups.setdefault((row.case.law, row.case.horizon), {}).setdefault(row.case.points, row)
        if row.case.precision == 64:
            groups[row.case.law, row.case.horizon][row.case.points] = row
    for (law, horizon), found in sorted(groups.items()):
        ladder = [found[n] for n in sorted(found)]
        if len(ladder) < 2:
            continue
        rates = [
            np.log(field_of(a) / field_of(b)) / np.log((b.case.points - 1) / (a.case.points - 1))
            for a, b in itertools.pairwise(ladder)
        ]
        errors = ", ".join(f"{r.case.points}: {100 * field_of(r):.3g} %" for r in ladder)
        lines.append(f"| {law} | {horizon:g} | {errors} | {', '.join(f'{rate:.1f}' for rate in rates)} |")
    return lines


def choices(rows: Sequence[Row]) -> list[str]:
    """What to take for a field error of 3, 1, 0.3 and 0.1 %: the fastest that reaches it, by scene and device."""
    lines = ["| scene | device | error | fastest | time s |", "|---|---|---|---|---|"]
    for study, device in itertools.product(STUDIES, sorted({row.device for row in rows})):
        here = [row for row in good(rows) if row.case.scene == study.scene and row.device == device]
        for wanted in TARGETS:
            reached = [row for row in here if field_of(row) <= wanted]
            if reached:
                best = min(reached, key=lambda r: r.seconds)
                lines.append(
                    f"| {study.scene} | {device} | {100 * wanted:g} % | {name_of(best.case)} | {best.seconds:.3g} |"
                )
    return lines


def failures(rows: Sequence[Row]) -> list[str]:
    """Lines of runs that gave no error."""
    return [f"- {name_of(r.case)}: {r.status}" for r in rows if r.field is None]


ADVICE = (
    "At rest take corrected weights and the smallest horizon (1.5 or 2.015): Newton's method in float64 on a CPU or",
    "for the last digits, relaxation in float32 on a GPU up to some 100 points a side. Beyond 2.015 wide horizons",
    "cost more a step and are wrong by more at equal spacing. Refine the spacing, not the horizon: corrected weights",
    "are second order, the others first or less, and published weights at 1.5 do not converge at all. In time take",
    "corrected weights at 2.015, explicit, float32. A horizon of 3.15 pays where the sheet tears, because cracks",
    "follow the grid below it ([tearing](tearing.md)). float32 is enough down to errors of 0.002 % (tension) to 0.04",
    "% (pressure). Laws without intersections (closed form, bond-based) pay only where several percent will do. A",
    "scene with few rows on a device tells little: the H200 has only plain weights for stretch.",
    "",
    "The finite elements are known at their nodes; at the points in between splines cost 1e-5 of the field. Rows of",
    "commits 9970489 and b1e4704 took other cubics, which cost 2e-4: their field errors end there.",
)


def page(rows: Sequence[Row], docs: Path = DOCS) -> str:
    """The page, from the rows of all devices; its pictures go to error-vs-time/ in `docs`."""
    lines = [
        "# Error against run time",
        "",
        "Made by `tools/error_vs_time.py`; numbers of every run are in `docs/error-vs-time/`. Time is that of a whole",
        "run without files, set-up included and compilation not, the median of repeated runs. Point-steps are points",
        "times force evaluations. Errors are relative to finite elements; the field error is the L2 norm of the",
        "difference of the displacements over that of the displacement. `published`, `plain`, `corrected` are weights",
        "of the bond-associated law, `bond_based` is linear (E = 3 mu, Poisson's ratio 1/3): another material at large",
        "strain. The number after a law is its horizon in spacings.",
        "",
    ]
    for study in STUDIES:
        here = [row for row in rows if row.case.scene == study.scene]
        if not here:
            continue
        lines += [f"## {study.scene}", "", study.about, ""]
        for device in sorted({row.device for row in here}):
            mine = [row for row in here if row.device == device]
            picture = f"error-vs-time/{study.scene}-{'cpu' if 'CPU' in device or 'cpu' in device else 'gpu'}.png"
            stands = "; ".join(sorted({row.stand.removeprefix("on ") for row in mine}))
            lines += [f"### On {device}", "", f"Measured: {stands}.", "", published_text(mine), ""]
            if good(mine):
                draw(mine, docs / picture)
                lines += [f"![{study.scene} on {device}]({picture})", "", *front_table(mine), ""]
            if failed := failures(mine):
                lines += ["No answer came from:", "", *failed, ""]
            lines += ["Observed orders in the spacing:", "", *orders(mine), ""]
    lines += ["## What to choose", "", *ADVICE, "", *choices(rows), ""]
    return "\n".join(lines)


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name)
    parser.add_argument("--scenes", nargs="+", default=[s.scene for s in STUDIES], choices=[s.scene for s in STUDIES])
    names = sorted({law for study in STUDIES for law in study.laws})
    parser.add_argument("--laws", nargs="*", default=[], choices=names, metavar="LAW", help="only these")
    parser.add_argument("--points", type=int, nargs="+", default=[26, 51, 101, 201, 401], help="along a side")
    parser.add_argument("--horizon", type=float, nargs="+", default=[1.5, 2.015, 3.15, 4.15])
    parser.add_argument("--precision", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--tear-points", type=int, nargs="+", default=[30, 60], help="of double_notch, 30 times 2^n")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--enough", type=float, default=10.0, help="seconds after which a case is not repeated")
    parser.add_argument(
        "--limit", type=float, default=120.0, help="seconds that a run may take; finer ones are left out"
    )
    parser.add_argument("--fast", action="store_true", help="a few small cases")
    parser.add_argument("--numbers", type=Path, default=FOLDER, help="folder of the numbers")
    parser.add_argument("--missing", action="store_true", help="run only what the numbers do not have yet")
    parser.add_argument("--page-only", action="store_true", help="make the page from the numbers there are")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    options = parser.parse_args(arguments)
    if options.fast:
        options.points, options.horizon, options.precision = [11, 21], [2.015, 3.15], [64]
        options.repeats, options.scenes = 1, ["pressure"]
        options.laws = options.laws or ["published", "corrected", "bond_based"]
    return options


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, keep the numbers, and make the page unless the numbers go elsewhere."""
    options = parsed(arguments)
    rows: list[Row] = []
    if not options.page_only:
        device = find_device(options.device)
        stand = stamp(device.name, options.stand)
        for study in STUDIES:
            if study.scene in options.scenes:
                rows += sweep(study, options, str(device), stand)
    if options.numbers == FOLDER:
        write_aside(PAGE, page(load(FOLDER)))
    else:
        print("\n".join(front_table(rows)))


if __name__ == "__main__":
    sys.exit(main())
