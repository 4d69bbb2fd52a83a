"""What a run leaves when something goes wrong: kills, damaged files, a full disk, lost terminals, two runs at once.

    python tools/faults.py --out docs/reliability.md        # all of it, half an hour on two CPU cores
    python tools/faults.py --kills 2 --places 1 --sizes 2   # a little

Every fault must end in a result equal to that of an undisturbed run to the bit, or in one line on standard error: no
traceback, no crash, no file that looks whole and is not. Each row counts the trials and those that failed.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from study import provenance, renew, run_tool, study_parser, table

from warp_pd.run.folder import results_in

SCENES: dict[str, list[str]] = {
    "explicit: ball_penetration": [
        "ball_penetration", "--points", "15", "--horizon", "2.015", "--duration", "2.4", "--frames", "24",
    ],
    "explicit: pure_shear_tear": [
        "pure_shear_tear", "--points", "10", "--duration", "0.5", "--frames", "20", "--set", "tearing_energy=4",
    ],
    "Relaxation: pressure": [
        "pressure", "--points", "11", "--solver", "relaxation", "--horizon", "2.015",
    ],
    "Newton: tension": ["tension", "--points", "21", "--solver", "newton"],
}  # fmt: skip
PATIENCE = 300.0


@dataclass
class Trial:
    """One fault.

    Attributes:
        fault: Its kind.
        scene: Where.
        wrong: What went wrong; empty if nothing did.
    """

    fault: str
    scene: str
    wrong: str


def command(scene: str, out: Path, *more: str) -> list[str]:
    """The command that runs a scene into a folder."""
    return [
        sys.executable, "-m", "warp_pd", "run", *SCENES[scene], "--device", "cpu", "--no-pictures", "--quiet",
        "--out", str(out), *more,
    ]  # fmt: skip


def run(arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(arguments, capture_output=True, text=True, check=False, timeout=PATIENCE)


def said_badly(done: subprocess.CompletedProcess[str], allowed: tuple[int, ...] = (0, 1, 2)) -> str:
    """What is wrong with how a command ended: a crash, or anything but one line."""
    lines = [line for line in done.stderr.strip().splitlines() if line.strip()]
    if done.returncode not in allowed:
        return f"exit code {done.returncode}: {' '.join(lines)[-200:]}"
    if "Traceback" in done.stderr or len(lines) > 1:
        return f"{len(lines)} lines: {lines[-1][-200:]}"
    if done.returncode != 0 and not lines:
        return f"exit code {done.returncode} without a word"
    return ""


def differs(folder: Path, whole: Path) -> str:
    """What differs between a resumed run and one that was never disturbed."""
    with np.load(folder / "restart.npz") as one, np.load(whole / "restart.npz") as other:
        for name in set(one.files) | set(other.files):
            if name == "numbers":
                continue
            if name not in one.files or name not in other.files or one[name].tobytes() != other[name].tobytes():
                return f"{name} differs"
    if (folder / "history.csv").read_text("utf-8") != (whole / "history.csv").read_text("utf-8"):
        return "history.csv differs"
    status = json.loads((folder / "summary.json").read_text("utf-8"))["status"]
    return "" if status == "finished" else f"status {status}"


def kills(scene: str, whole: Path, seconds: float, number: int, work: Path) -> Iterator[Trial]:
    """Kill a run at random moments, then resume it, or begin anew where there is nothing to resume."""
    rng = np.random.default_rng(0)
    for index in range(number):
        out = work / f"kill-{index}"
        running = subprocess.Popen(command(scene, out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(float(rng.uniform(0.3, 1.0)) * seconds)
        running.kill()
        running.wait()
        how = "--resume" if (out / "restart.npz").exists() else "--overwrite"
        done = run(command(scene, out, how))
        wrong = said_badly(done, (0,))
        yield Trial("kill -9, then resumed", scene, wrong or differs(out, whole))
        shutil.rmtree(out)


def truncations(scene: str, whole: Path, places: int, chosen: Sequence[str], work: Path) -> Iterator[Trial]:
    """Cut each file short at some places, then ask for the contents and resume."""
    for name in (file for file in results_in(whole) if not chosen or file in chosen):
        size = (whole / name).stat().st_size
        for place in range(places):
            out = work / f"cut-{name}-{place}"
            shutil.copytree(whole, out)
            (out / name).write_bytes((whole / name).read_bytes()[: size * place // places])
            for more in (["info", str(out / name)], ["info", str(out)]):
                done = run([sys.executable, "-m", "warp_pd", *more])
                yield Trial("file cut short, info", scene, _named(name, said_badly(done)))
            done = run(command(scene, out, "--resume"))
            yield Trial("file cut short, resumed", scene, _named(name, said_badly(done)))
            shutil.rmtree(out)


def _named(name: str, wrong: str) -> str:
    return f"{name}: {wrong}" if wrong else ""


def changes(scene: str, whole: Path, number: int, chosen: Sequence[str], work: Path) -> Iterator[Trial]:
    """Change some bytes of each file, then ask for the contents and the page, and resume."""
    rng = np.random.default_rng(1)
    out = work / "changed"
    for name in (file for file in results_in(whole) if not chosen or file in chosen):
        for _ in range(number):
            shutil.copytree(whole, out)
            data = bytearray((whole / name).read_bytes())
            for at in rng.integers(len(data), size=int(rng.integers(1, 9))):
                data[at] ^= 1 << int(rng.integers(8))
            (out / name).write_bytes(data)
            for more in (["info", str(out)], ["view", str(out), "--out", str(work / "page.html")]):
                done = run([sys.executable, "-m", "warp_pd", *more])
                yield Trial(f"bytes changed, {more[0]}", scene, _named(name, said_badly(done)))
            done = run(command(scene, out, "--resume"))
            yield Trial("bytes changed, resumed", scene, _named(name, said_badly(done)))
            shutil.rmtree(out)


def lost_terminals(scene: str, whole: Path, seconds: float, work: Path) -> Iterator[Trial]:
    """Standard error closed, full, or a pipe whose reader is gone; and the signal of a lost terminal, then resumed."""
    out = work / "lost"
    shown = [text for text in command(scene, out) if text != "--quiet"]
    for where in ("2>&-", ">&- 2>&-", "2> /dev/full", "> /dev/full 2>&1", "> >(true) 2> >(true)"):
        done = run(["bash", "-c", f"{shlex.join(shown)} {where}"])
        wrong = f"exit code {done.returncode}" if done.returncode != 0 else differs(out, whole)
        yield Trial("lost terminal", scene, wrong and f"{where}: {wrong}")
        shutil.rmtree(out, ignore_errors=True)
    running = subprocess.Popen(command(scene, out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(0.7 * seconds)
    running.send_signal(signal.SIGHUP)
    code = running.wait(PATIENCE)
    # Before a run has begun a signal ends a process as Python says.
    wrong = "" if code in (0, 128 + signal.SIGHUP, -signal.SIGHUP) else f"exit code {code}"
    how = "--resume" if (out / "restart.npz").exists() else "--overwrite"
    done = run(command(scene, out, how))
    yield Trial("SIGHUP, then resumed", scene, wrong or said_badly(done, (0,)) or differs(out, whole))
    shutil.rmtree(out)


def disk_sizes(whole: Path, number: int) -> list[int]:
    """Sizes of disks: half of them over all, half in the 2 MB around that at which a run just ends."""
    end = sum((whole / name).stat().st_size for name in results_in(whole))
    full = 4 * end + 2_000_000
    over_all = [full * (k + 1) // (number // 2 + 1) for k in range(number // 2)]
    rest = number - number // 2
    near_end = [end - 500_000 + 2_000_000 * (2 * k + 1) // (2 * rest) for k in range(rest)]
    return [max(100_000, size) for size in over_all + near_end]


def full_disks(scene: str, whole: Path, sizes: int, work: Path) -> Iterator[Trial]:
    """Run on a disk that is too small; then it has room, and the run is resumed or begun anew. Needs root."""
    if os.geteuid() != 0:
        return
    disk = work / "disk"
    disk.mkdir()
    for size in disk_sizes(whole, sizes):
        if run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(disk)]).returncode != 0:
            print("full disk: not tried, as this machine mounts none")
            break
        try:
            out = disk / "run"
            done = run(command(scene, out))
            wrong = said_badly(done)
            yield Trial("full disk", scene, wrong or (differs(out, whole) if done.returncode == 0 else ""))
            run(["mount", "-o", f"remount,size={10 * size + 100_000_000}", str(disk)])
            if done.returncode != 0:
                how = "--resume" if (out / "restart.npz").exists() else "--overwrite"
                again = run(command(scene, out, how))
                yield Trial("room again after a full disk", scene, said_badly(again, (0,)) or differs(out, whole))
        finally:
            run(["umount", str(disk)])
    disk.rmdir()


def two_at_once(scene: str, whole: Path, work: Path) -> Iterator[Trial]:
    """A second run into the folder of one that is under way."""
    out = work / "twice"
    first = subprocess.Popen(command(scene, out), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while not (out / ".lock").exists() and first.poll() is None:
        time.sleep(0.01)
    # It stands still meanwhile: a short run would end before the other one has begun.
    time.sleep(0.05)
    first.send_signal(signal.SIGSTOP)
    second = run(command(scene, out, "--overwrite"))
    first.send_signal(signal.SIGCONT)
    wrong = said_badly(second) or ("the second ran" if second.returncode == 0 else "")
    yield Trial("two runs at once, the second", scene, wrong)
    _, errors = first.communicate(timeout=PATIENCE)
    yield Trial("two runs at once, the first", scene, errors.strip()[-200:] or differs(out, whole))
    shutil.rmtree(out)


def main() -> None:
    """Try everything, then write the page."""
    parser = study_parser(__doc__, device="cpu", out=None)
    parser.add_argument("--kills", type=int, default=50, help="of each scene")
    parser.add_argument("--places", type=int, default=20, help="at which each file is cut")
    parser.add_argument("--changes", type=int, default=10, help="of bytes of each file")
    parser.add_argument("--files", nargs="*", default=[], help="that are cut; by default all")
    parser.add_argument("--sizes", type=int, default=50, help="of a full disk")
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=list(SCENES))
    kinds = ("kills", "truncations", "changes", "full_disks", "lost_terminals", "two_at_once")
    parser.add_argument("--faults", nargs="*", default=kinds, choices=kinds)
    options = parser.parse_args()
    trials: list[Trial] = []
    with tempfile.TemporaryDirectory(prefix="warp_pd_faults_") as folder:
        work = Path(folder)
        for scene in options.scenes:
            whole = work / "whole"
            run(command(scene, whole))
            begin = time.perf_counter()
            shutil.rmtree(whole)
            done = run(command(scene, whole))
            seconds = time.perf_counter() - begin
            if done.returncode != 0:
                raise RuntimeError(f"{scene}: {done.stderr}")
            tried = {
                "kills": kills(scene, whole, seconds, options.kills, work),
                "truncations": truncations(scene, whole, options.places, options.files, work),
                "changes": changes(scene, whole, options.changes, options.files, work),
                "full_disks": full_disks(scene, whole, options.sizes, work),
                "lost_terminals": lost_terminals(scene, whole, seconds, work),
                "two_at_once": two_at_once(scene, whole, work),
            }
            for kind in options.faults:
                for trial in tried[kind]:
                    trials.append(trial)
                    if trial.wrong:
                        print(f"{trial.fault}, {trial.scene}: {trial.wrong}", flush=True)
            shutil.rmtree(whole)
    failed = sum(bool(trial.wrong) for trial in trials)
    print(f"{len(trials)} trials, {failed} failed")
    if options.out is not None:
        renew(options.out, {"## Trials": lines_of(trials)})
    if failed:
        sys.exit(1)


def lines_of(trials: Sequence[Trial]) -> list[str]:
    """Where and when, and one line for each fault and scene."""
    rows = []
    for fault in dict.fromkeys(trial.fault for trial in trials):
        for scene in dict.fromkeys(trial.scene for trial in trials):
            some = [trial for trial in trials if (trial.fault, trial.scene) == (fault, scene)]
            wrong = sorted({trial.wrong for trial in some if trial.wrong})
            rows.append([fault, scene, f"{len(some)}", f"{sum(bool(t.wrong) for t in some)}", "; ".join(wrong)[:200]])
    made = provenance(f"{os.cpu_count()} CPU cores")
    return [f"Measured on {made}.", "", *table(["fault", "scene", "trials", "failed", "how"], rows)]


if __name__ == "__main__":
    run_tool(main)
