"""Tables and pictures of docs/peers.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from study import picture, table

from peers.codes import CODES
from peers.problems import PROBLEMS, Problem

Row = Mapping[str, Any]
HEAD = ["code", "points", "error [%]", "of its own material [%]", "time [s]", "memory [MB], up to"]
ERRORS = (0.05, 0.02, 0.01, 0.001)


def sections(rows: Sequence[Row], page: Path) -> dict[str, list[str]]:
    """Sections by heading: what is fastest, one for each problem and device, the codes."""
    found = {"## The fastest": fastest(rows)}
    versions = {r["code"]: r["version"] for r in rows if r.get("version")}
    for name, problem in PROBLEMS.items():
        for device in dict.fromkeys(r["device"] for r in rows if r["problem"] == name):
            here = [r for r in rows if r["problem"] == name and r["device"] == device]
            file = page.with_name(f"{page.stem}-{name}{'' if device == 'CPU' else '-gpu'}.png")
            draw(here, file)
            found[f"## {problem.title}: {device}"] = [
                f"{', '.join(dict.fromkeys(r['made'] for r in here))}. {measured_by(problem, here)}",
                "", f"![error over time]({file.name})", "", *table(HEAD, by_code(here)), "",
                *without(name, device), "",
            ]  # fmt: skip
    found["## How each code was used"] = [
        f"- **{code.name}** ({versions[code.name]}): {code.how}." for code in CODES if code.name in versions
    ]
    return found


def without(problem: str, device: str) -> list[str]:
    """Codes that have no row, and why; those without a GPU path are named once, in the text of the page."""
    if device != "CPU":
        return []
    found: dict[str, list[str]] = {}
    for code in CODES:
        if problem in code.cannot:
            found.setdefault(code.cannot[problem], []).append(code.name)
    return [f"- No row of {'; '.join(names)}: {reason}." for reason, names in found.items()]


def measured_by(problem: Problem, rows: Sequence[Row]) -> str:
    """What the error is."""
    if problem.cut:
        ratios = ", ".join(
            f"{r['code']} ({r['points']}) {r['release_ratio']:.3f}" for r in rows if r.get("release_ratio")
        )
        return f"The error is that of G / Gc, exactly 1 when the cut grows (Rivlin and Thomas 1953): {ratios}."
    changes = [r["reference_change"] for r in rows if r.get("reference_change")]
    whose = "is this code with 97 points; it " if problem.bending else ""
    return f"The reference {whose}changes by {max(changes, default=0.0):.1g} when its spacing is halved."


def by_code(rows: Sequence[Row]) -> list[list[str]]:
    """A line of a table for each code, its runs one after the other."""
    return [cells([r for r in rows if r["code"] == code]) for code in dict.fromkeys(r["code"] for r in rows)]


def cells(runs: Sequence[Row]) -> list[str]:
    """The line of the runs of one code."""
    done = [r for r in runs if not r.get("failed")]
    own = [r["own_error"] for r in done if r.get("own_error")]
    most = max((r.get("memory") or 0.0 for r in done), default=0.0)
    return [
        runs[0]["code"], ", ".join(str(r["points"]) for r in runs),
        ", ".join(r["failed"] if r.get("failed") else percent(r["error"]) for r in runs),
        ", ".join(map(percent, own)), ", ".join(f"{seconds(r):.3g}" for r in done), f"{most / 1e6:.0f}" if most else "",
    ]  # fmt: skip


def percent(share: float) -> str:
    """Two digits, in percent."""
    return f"{100.0 * share:.2g}"


def seconds(row: Row) -> float:
    """CPU time on a CPU, wall time on a GPU [s]."""
    return float(row["cpu"] if row["device"] == "CPU" else row["wall"])


def fastest(rows: Sequence[Row]) -> list[str]:
    """The least time of each code for an error, a column for each error."""
    lines = []
    for name in PROBLEMS:
        for device in dict.fromkeys(r["device"] for r in rows if r["problem"] == name):
            for code in dict.fromkeys(r["code"] for r in rows if r["problem"] == name and r["device"] == device):
                done = [
                    r for r in rows if (r["problem"], r["device"], r["code"]) == (name, device, code) and r.get("error")
                ]
                best = [least_time(done, e) for e in ERRORS]
                if any(best):
                    lines.append([name, device, code, *("-" if t is None else f"{t:.3g}" for t in best)])
    head = ["problem", "device", "code", *(f"{100 * e:g} %: [s]" for e in ERRORS)]
    return [
        "Seconds, of CPU on a CPU and by the clock on a GPU, for an error that finer runs of the code keep;",
        "codes that are further off at every spacing are left out:", "",
        *table(head, lines), "",
    ]  # fmt: skip


def least_time(rows: Sequence[Row], error: float) -> float | None:
    """Least time [s] of the runs of a code within an error; one that a finer run leaves again is a coincidence."""
    beyond = max((r["points"] for r in rows if r["error"] > error), default=0)
    return min((seconds(r) for r in rows if r["points"] > beyond), default=None)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Error over time, a line for each code; dashed, to its own material."""
    with picture(path, size=(7.0, 4.6)) as axes:
        panel = axes[0, 0]
        for i, code in enumerate(dict.fromkeys(r["code"] for r in rows)):
            done = [r for r in rows if r["code"] == code and r.get("error")]
            if not done:
                continue
            times = [seconds(r) for r in done]
            panel.loglog(times, [r["error"] for r in done], "o-", color=f"C{i}", label=code)
            if done[0].get("own_error"):
                panel.loglog(
                    times, [r["own_error"] for r in done], "x--", color=f"C{i}", label=f"{code}, its own material"
                )
        panel.set_xlabel("CPU time (s)" if rows[0]["device"] == "CPU" else "wall time (s)")
        panel.set_ylabel("error (-)")
        panel.legend(fontsize=7)
