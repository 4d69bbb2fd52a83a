"""What the tools share: command-line options, runs of scenes, the header of a page, and one-line errors."""

from __future__ import annotations

import argparse
import datetime
import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from warp_pd import InputError
from warp_pd.interfaces.context import find_device
from warp_pd.run.divergence import DivergedError
from warp_pd.run.folder import write_atomically

ROOT = Path(__file__).resolve().parents[1]
DOCS, RUNS = ROOT / "docs", ROOT / "runs"
# Finite-element solutions.
REFERENCES = ROOT / "tests" / "physics" / "references" / "data"
WRONG_INPUT, DIVERGED = 2, 3


# Where a page comes from ------------------------------------------------------------------------------------


def current_commit() -> str:
    """Short hash of the checked-out commit, or "unknown" outside a repository."""
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "unknown"


def provenance(device: str, commit: str | None = None) -> str:
    """Text like "on DEVICE, DATE, commit HASH". `commit` replaces the checked-out one."""
    return f"on {device}, {datetime.date.today()}, commit {commit or current_commit()}"


def page_header(tool: str, device: str, commit: str | None = None) -> str:
    """The sentence below the title of a page. `tool` is relative to tools/, such as "scenes.py"."""
    return f"Made by `tools/{tool}` {provenance(device, commit)}."


def write_page(path: Path, text: str) -> None:
    """Write a page and say so. Creates its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text)
    print(f"wrote {path}")


def paragraph(text: str) -> list[str]:
    """Lines of a paragraph, and an empty one after it."""
    return [*_wrapped(text), ""]


def bullet(text: str) -> list[str]:
    """Lines of an entry of a list."""
    return _wrapped(f"- {text}", indent="  ")


def _wrapped(text: str, indent: str = "") -> list[str]:
    return textwrap.wrap(text, 120, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a markdown table."""
    return [table_row(head), "|" + "---|" * len(head), *map(table_row, rows)]


def table_row(cells: Sequence[str]) -> str:
    """One line of a markdown table."""
    return f"| {' | '.join(cells)} |"


# The command line -------------------------------------------------------------------------------------------


def device_name(text: str) -> str:
    """Type of the option --device: the name itself. argparse reports a device that does not exist."""
    try:
        find_device(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def at_least_one(text: str) -> int:
    """Type of options that count something: a whole number of 1 or more."""
    number = int(text) if text.isdecimal() else 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number of 1 or more")
    return number


OPTIONS: dict[str, dict[str, Any]] = {
    "device": {"type": device_name, "help": "such as cpu or cuda:0"},
    "jobs": {"type": at_least_one, "help": "number of runs at a time"},
    "work": {"type": Path, "help": "folder of the runs; finished runs in it are not repeated"},
    "out": {"type": Path, "help": "file to write; pictures go beside it"},
    "only_page": {"action": "store_true", "help": "run nothing; make the page from the runs in the work folder"},
    "commit": {"help": "commit to name on the page, for a copy without a repository"},
}
# Older names of options. They still work.
ALIASES = {"only_page": "--page-only", "commit": "--stand"}


def study_parser(description: str | None, **defaults: Any) -> argparse.ArgumentParser:
    """The command line of a study.

    Args:
        description: Docstring of the tool.
        defaults: The shared options that the study takes, by name in OPTIONS, with their default values. Where --out
            has a default, a folder is accepted too: it gets a file of the same name.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in defaults.items():
        option = {**OPTIONS[name], "default": default}
        if name == "out" and default is not None:
            option["type"] = partial(_file_in, name=default.name)
        flag = "--" + name.replace("_", "-")
        parser.add_argument(flag, **option)
        if name in ALIASES:
            hidden = {**option, "dest": name, "default": argparse.SUPPRESS, "help": argparse.SUPPRESS}
            parser.add_argument(ALIASES[name], **hidden)
    return parser


def _file_in(text: str, name: str) -> Path:
    path = Path(text)
    return path if path.suffix == Path(name).suffix else path / name


def run_tool(main: Callable[[], object]) -> None:
    """Run a tool. Wrong input and diverged runs end it with one line and the exit code of `warp-pd`."""
    try:
        main()
    except (InputError, DivergedError) as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        sys.exit(WRONG_INPUT if isinstance(error, InputError) else DIVERGED)


# Runs of scenes ---------------------------------------------------------------------------------------------


class Case:
    """One run of a scene. A study inherits from it.

    Attributes:
        scene: Name of the scene.
        settings: Arguments of the scene that differ from their defaults.
        draws_pictures: Whether the run draws the pictures of the scene.
    """

    scene: str
    settings: Mapping[str, Any]
    draws_pictures: bool = False

    @property
    def name(self) -> str:
        """Name of the folder of its results."""
        return "-".join([self.scene, *(f"{key}={value}" for key, value in self.settings.items())])

    def summary(self, work: Path) -> dict[str, Any] | None:
        """Content of its summary.json, or None if it has not ended yet."""
        path = work / self.name / "summary.json"
        return json.loads(path.read_text()) if path.is_file() else None


def execute(case: Case, work: Path, device: str) -> None:
    """Run a case with `warp-pd run`, unless its folder in `work` holds a summary already."""
    if case.summary(work) is not None:
        return
    command = [sys.executable, "-m", "warp_pd.__main__", "run", case.scene, "--device", device]
    command += ["--out", str(work / case.name), "--no-usd", "--quiet", "--overwrite"]
    command += [] if case.draws_pictures else ["--no-pictures"]
    for key, value in case.settings.items():
        command += ["--set", f"{key}={value}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    print(f"{case.name}: exit {done.returncode} {done.stderr.strip()[-200:]}", flush=True)


def execute_all(cases: Iterable[Case], options: argparse.Namespace) -> None:
    """Run cases, as many at a time as there are jobs. Runs nothing with --only-page."""
    if options.only_page:
        return
    with ThreadPoolExecutor(options.jobs) as pool:
        list(pool.map(lambda case: execute(case, options.work, options.device), cases))


def in_processes(
    work: Callable[..., dict[str, Any]], cases: Iterable[Sequence[Any]], jobs: int
) -> list[dict[str, Any]]:
    """Results of a function of the module for all cases, each printed as a line of JSON as it comes.

    Args:
        work: The function; it gets a case as its arguments, in a process of its own.
        cases: Arguments.
        jobs: Number of processes. Each has a core: many processes with many threads each slow each other down.
    """
    context = get_context("spawn")
    cores = context.Queue()
    for core in range(jobs):
        cores.put(core)
    found = []
    with ProcessPoolExecutor(jobs, context, initializer=_take_core, initargs=(cores,)) as pool:
        for run in as_completed([pool.submit(work, *case) for case in cases]):
            found.append(run.result())
            print(json.dumps(found[-1]), flush=True)
    return found


def _take_core(cores: Any) -> None:
    available = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {available[cores.get() % len(available)]})


def write_runs(path: Path, key: str, runs: Sequence[Mapping[str, Any]], options: argparse.Namespace) -> None:
    """Write runs as JSON under a key, with the commit and the device of the options."""
    kept = {"commit": options.commit or current_commit(), "device": options.device, key: runs}
    write_atomically(path, json.dumps(kept, indent=1) + "\n")


def devices_of(summaries: Iterable[Mapping[str, Any] | None], otherwise: str = "") -> str:
    """Names of the devices that runs took; `otherwise` if there is no run."""
    return ", ".join(sorted({str(summary["device"]) for summary in summaries if summary})) or otherwise
