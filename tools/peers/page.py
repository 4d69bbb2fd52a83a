"""Tables and pictures of docs/peers.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from study import picture, table

from peers.codes import CODES, Code
from peers.problems import PROBLEMS, Problem

Row = Mapping[str, Any]
ERRORS = (0.05, 0.02, 0.01, 0.001)


def sections(rows: Sequence[Row], page: Path) -> dict[str, list[str]]:
    """Sections by heading: what is fastest, one for each problem, the codes; a CPU first, the codes in their order."""
    place = {code.name: at for at, code in enumerate(CODES)}
    rows = sorted(rows, key=lambda r: (r["device"] != "CPU", place[r["code"]], r["points"]))
    found = {"## The fastest": fastest(rows)}
    versions = {r["code"]: r["version"] for r in rows if r.get("version")}
    for name, problem in PROBLEMS.items():
        here = [r for r in rows if r["problem"] == name]
        if not here:
            continue
        file = page.with_name(f"{page.stem}-{name}.png")
        draw(here, file)
        made = "; ".join(dict.fromkeys(r["made"] for r in here))
        found[f"## {problem.title}"] = [
            f"{made}. {measured_by(problem, here)}", "", f"![error over time]({file.name})", "", *by_code(here), "",
        ]  # fmt: skip
    found["## How each code was used"] = [
        f"- **{code.name}** ({versions[code.name]}): {code.how}.{without(code)}"
        for code in CODES
        if code.name in versions
    ]
    return found


def without(code: Code) -> str:
    """Problems that a code has no row of, and why."""
    reasons: dict[str, list[str]] = {}
    for problem, reason in code.cannot.items():
        reasons.setdefault(reason, []).append(problem)
    found = "; ".join(f"{', '.join(problems)} ({reason})" for reason, problems in reasons.items())
    return f" No row: {found}." if found else ""


def measured_by(problem: Problem, rows: Sequence[Row]) -> str:
    """What the error is."""
    if problem.cut:
        return "The error is that of G / Gc, exactly 1 when the cut grows (Rivlin and Thomas 1953)."
    changes = [r["reference_change"] for r in rows if r.get("reference_change")]
    whose = "is this code with 97 points; it " if problem.bending else ""
    return f"The reference {whose}changes by {max(changes, default=0.0):.1g} when its spacing is halved."


def by_code(rows: Sequence[Row]) -> list[str]:
    """The table of a problem: the finest run of each code; two lines where devices disagree about it."""
    devices = list(dict.fromkeys(r["device"] for r in rows))
    lines = []
    for code in dict.fromkeys(r["code"] for r in rows):
        runs = [[r for r in rows if (r["code"], r["device"]) == (code, d)] for d in devices]
        finest = [max(found, key=lambda r: r["points"], default=None) for found in runs]
        for points, told in dict.fromkeys((r["points"], error(r)) for r in finest if r):
            times = [time_of(r) if r and (r["points"], error(r)) == (points, told) else "" for r in finest]
            lines.append([code, str(points), told, *times])
    return table(["code, finest run", "points", "error [%]", *(f"{d} [s]" for d in devices)], lines)


def error(row: Row) -> str:
    """The error [%], of a tear with its sign, in brackets that to its own material; or why there is none."""
    if row.get("failed"):
        return str(row["failed"])
    if row.get("release_ratio"):
        return f"{100.0 * (row['release_ratio'] - 1.0):+.2g}"
    own = f" ({percent(row['own_error'])})" if row.get("own_error") else ""
    return percent(row["error"]) + own


def time_of(row: Row) -> str:
    """Seconds of a run that ended, else a dash."""
    return "-" if row.get("failed") else f"{seconds(row):.3g}"


def percent(share: float) -> str:
    """Two digits, in percent."""
    two_digits = f"{100.0 * share:.2g}"
    return f"{float(two_digits):g}"


def seconds(row: Row) -> float:
    """CPU time on a CPU, wall time on a GPU [s]."""
    return float(row["cpu"] if row["device"] == "CPU" else row["wall"])


def fastest(rows: Sequence[Row]) -> list[str]:
    """The least time of each code, whichever of its solvers, for an error; the devices one after the other."""
    devices = list(dict.fromkeys(r["device"] for r in rows))
    lines = []
    for name in PROBLEMS:
        here = [r for r in rows if r["problem"] == name and r.get("error")]
        for code in dict.fromkeys(family(r) for r in here):
            of_code = [[r for r in here if family(r) == code and r["device"] == device] for device in devices]
            best = [[least_time(runs, e) for runs in of_code if runs] for e in ERRORS]
            if any(t for times in best for t in times):
                lines.append([name, code, *(" / ".join("-" if t is None else f"{t:.3g}" for t in b) for b in best)])
    return [
        "Seconds, of CPU on a CPU and by the clock on a GPU, for an error that finer runs keep, with the best solver "
        f"or elements of a code; devices: {' / '.join(devices)}. Codes further off at all spacings are left out.",
        "", *table(["problem", "code", *(f"{100 * e:g} %" for e in ERRORS)], lines), "",
    ]  # fmt: skip


def family(row: Row) -> str:
    """The code of a run, without its solver or elements."""
    return str(row["code"]).partition(",")[0]


def least_time(rows: Sequence[Row], error: float) -> float | None:
    """Least time [s] of runs within an error; one that a finer run of the same kind leaves again is a coincidence."""
    times = []
    for code in {r["code"] for r in rows}:
        beyond = max((r["points"] for r in rows if r["code"] == code and r["error"] > error), default=0)
        times += [seconds(r) for r in rows if r["code"] == code and r["points"] > beyond]
    return min(times, default=None)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Error over time, a panel for each device and a line for each code; dashed, to its own material."""
    devices = list(dict.fromkeys(r["device"] for r in rows))
    colours = {code: f"C{i}" for i, code in enumerate(dict.fromkeys(r["code"] for r in rows))}
    with picture(path, columns=len(devices), size=(5.5, 4.2)) as axes:
        for panel, device in zip(axes[0], devices, strict=True):
            for code, colour in colours.items():
                done = [r for r in rows if (r["code"], r["device"]) == (code, device) and r.get("error")]
                if not done:
                    continue
                times = [seconds(r) for r in done]
                panel.loglog(times, [r["error"] for r in done], "o-", color=colour, label=code)
                if done[0].get("own_error"):
                    panel.loglog(
                        times, [r["own_error"] for r in done], "x--", color=colour, label=f"{code}, its own material"
                    )
            panel.set_title(device, fontsize=9)
            panel.set_xlabel("CPU time (s)" if device == "CPU" else "wall time (s)")
            panel.set_ylabel("error (-)")
            panel.legend(fontsize=7)
