"""Compare the bond-based law with LAMMPS and pypd: same machine, same bonds, in turn.

tools/peers/install.sh                                  once: the peers in runs/peers
python tools/peers/compare.py --out docs/peers.md       a few minutes; nothing else should be running

A sheet of points on a square lattice, horizon 3.015 spacings, 28 partners inside; float64; forces, integration and
the test whether a bond breaks, every step. All codes run in turn, several times; the best time of each counts.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from stamp import stamp  # noqa: E402

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
        "from warp_pd.bench import Case, measure; "
        f"print(measure(Case({points}, 3.015, {precision}, ('rupture',), law={law!r}), 'cpu', 2.0).step)"
    )
    return float(peers.run([sys.executable, "-c", code]).split()[-1])


def table(times: dict[str, list[float]], points: int) -> list[str]:
    """Rows of codes, best first line ours: point-steps a second, best and median, and how often ours is faster."""
    own = min(next(iter(times.values())))
    lines = ["| code | point-steps/s, best | median | bond-based over this |", "|---|---|---|---|"]
    for name, measured in times.items():
        middle = sorted(measured)[len(measured) // 2]
        lines.append(
            f"| {name} | {points**2 / min(measured):.3g} | {points**2 / middle:.3g} | {min(measured) / own:.2f} |"
        )
    return lines


def main() -> None:
    """Measure in turn, print, and write the page if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", type=Path, default=Path("runs/peers"), help="folder that install.sh made")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--points", type=int, default=256, help="along a side, for LAMMPS")
    parser.add_argument("--pypd-points", type=int, default=64, help="along a side, for pypd")
    parser.add_argument("--out", type=Path, help="page to write")
    options = parser.parse_args()
    folder = options.peers.resolve()
    if not (folder / "venv/bin/lmp").exists():
        parser.error(f"--peers = {str(options.peers)!r}: no LAMMPS there; run tools/peers/install.sh first")
    one, two, n = Peers(folder, "0"), Peers(folder, "0,1"), options.points
    first: dict[str, list[float]] = {"warp_pd, bond-based": [], "LAMMPS peri/pmb": [], "LAMMPS peri/lps": []}
    first["warp_pd, bond-associated, 28 stresses a point"] = []
    for _ in range(options.rounds):
        first["warp_pd, bond-based"].append(ours(one, "bond_based", n, 64))
        first["LAMMPS peri/pmb"].append(lammps(one, "peri/pmb", n, 200))
        first["LAMMPS peri/lps"].append(lammps(one, "peri/lps", n, 100))
        first["warp_pd, bond-associated, 28 stresses a point"].append(ours(one, "bond_associated", n, 64))
    lines = [f"## One core, {n} x {n} points", "", *table(first, n), ""]
    if (folder / "pypd").is_dir():
        n = options.pypd_points
        second: dict[str, list[float]] = {"warp_pd, bond-based": [], "pypd (Numba, displacements in the plane)": []}
        for _ in range(options.rounds):
            second["warp_pd, bond-based"].append(ours(two, "bond_based", n, 64))
            second["pypd (Numba, displacements in the plane)"].append(pypd(two, n, 400))
        lines += [f"## Two cores, {n} x {n} points", "", *table(second, n), ""]
    print("\n".join(lines))
    if options.out is not None:
        processor = next(
            (x.split(":")[1].strip() for x in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in x),
            "CPU",
        )
        options.out.write_text("\n".join([*introduction(processor), *lines, *REMARKS]))


def introduction(processor: str) -> list[str]:
    """What was measured, and where."""
    return [
        "# Beside other codes",
        "",
        f"Measured by `tools/peers/compare.py` {stamp(processor)}.",
        "Square lattice, horizon 3.015 spacings, float64, whole steps with the test whether a bond breaks. All codes",
        "ran in turn, several rounds; the best of each counts.",
        "",
    ]


REMARKS = [
    "LAMMPS's newer BPM package is reported to run peridynamic bonds 3.6 to 5.5 times faster than `peri/pmb`; it was",
    "not compared. LAMMPS also looks for contact between points without a bond. pypd moves points in the plane alone.",
    "Nobody else publishes times of a bond-associated law: ours is here to be compared with.",
    "",
]


if __name__ == "__main__":
    main()
