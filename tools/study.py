"""What the studies share: options, numbers with their origin, pages, pictures, one-line errors.

Modules of the package without public names are imported here and nowhere else in the studies, as far as possible.
"""

from __future__ import annotations

import argparse
import datetime
import importlib
import json
import os
import pkgutil
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import warp_pd.scenes
from warp_pd import InputError, Result
from warp_pd.command.scene_files import build_scene
from warp_pd.context import find_device
from warp_pd.device.checks import DIVERGED, WRONG_INPUT
from warp_pd.interfaces import DivergedError
from warp_pd.interfaces.solver import STOPPED
from warp_pd.run.folder import write_atomically
from warp_pd.run.stopping import deadline

__all__ = ["DivergedError", "InputError", "build_scene"]
ROOT = Path(__file__).resolve().parents[1]
DOCS, RUNS = ROOT / "docs", ROOT / "runs"
# Finite-element solutions.
REFERENCES = ROOT / "tests" / "papers" / "references" / "data"
Row = dict[str, Any]


# Scenes -----------------------------------------------------------------------------------------------------


def scene_names() -> list[str]:
    """Names of all scenes."""
    return sorted(module.name for module in pkgutil.iter_modules(warp_pd.scenes.__path__))


def load_scene(name: str) -> Any:
    """The module of a scene."""
    return importlib.import_module(f"warp_pd.scenes.{name}")


def in_processes(work: Callable[..., Any], cases: Iterable[tuple], jobs: int) -> Iterator[tuple[tuple, Any]]:
    """Call a function of a module for all cases; yields each case and its result as it comes.

    Args:
        work: The function; a case is its arguments.
        cases: Arguments.
        jobs: Number of processes; 1 takes this one. Each has a core: many processes with many threads each slow each
            other down.
    """
    if jobs == 1:
        yield from ((case, work(*case)) for case in cases)
        return
    # A forked process could not use CUDA.
    context = get_context("spawn")
    cores = context.Queue()
    for core in range(jobs):
        cores.put(core)
    with ProcessPoolExecutor(jobs, context, initializer=_take_core, initargs=(cores,)) as pool:
        running = {pool.submit(work, *case): case for case in cases}
        for done in as_completed(running):
            yield running[done], done.result()


def _take_core(cores: Any) -> None:
    available = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {available[cores.get() % len(available)]})


# Numbers and where they come from ---------------------------------------------------------------------------


def device_title(device: str | None) -> str:
    """Name of a device for readers, such as "NVIDIA H200"; None is the one that runs take."""
    return str(find_device(device).name)


def provenance(device: str) -> str:
    """Text like "NVIDIA H200, 2026-11-22"."""
    return f"{device}, {datetime.date.today()}"


def load_rows(path: Path) -> list[Row]:
    """Rows of earlier calls; none if there is no file."""
    if not path.is_file():
        return []
    stored = json.loads(path.read_text("utf-8"))
    rows = [dict(zip(stored["columns"], row, strict=True)) for row in stored["rows"]]
    for row in rows if "origins" in stored else ():
        row["made"] = stored["origins"][row["made"]]
    return rows


def save_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows, one a line under their common columns, with six digits; `made` is a place in `origins`."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    origins: list[str] = list(dict.fromkeys(row["made"] for row in rows if "made" in row))
    if origins:
        rows = [{**row, "made": origins.index(row["made"])} for row in rows]
    lines = [json.dumps([_six_digits(row.get(name)) for name in columns], separators=(",", ":")) for row in rows]
    named = f'"origins": {json.dumps(origins)},\n' if origins else ""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, f'{{"columns": {json.dumps(columns)},\n{named}"rows": [\n' + ",\n".join(lines) + "\n]}\n")


def _six_digits(value: Any) -> Any:
    return float(f"{value:.6g}") if isinstance(value, float) else value


# Pages and pictures -----------------------------------------------------------------------------------------


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a markdown table."""
    return [table_row(head), "|" + "---|" * len(head), *map(table_row, rows)]


def table_row(cells: Sequence[str]) -> str:
    """One line of a markdown table."""
    return f"| {' | '.join(cells)} |"


def write_page(path: Path, text: str) -> None:
    """Write a page and say so. Creates its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text)
    print(f"wrote {path}")


def renew(path: Path, sections: Mapping[str, Sequence[str]]) -> None:
    """Replace sections of a page that a study makes; its text is written by hand, in sections of its own.

    Args:
        path: The page.
        sections: Lines by heading, such as "## Verdicts". A section ends at the next heading. One that the page does
            not have comes at its end.
    """
    text = path.read_text("utf-8") if path.is_file() else ""
    for heading, lines in sections.items():
        section = "\n".join([heading, "", *lines]).rstrip() + "\n\n"
        found = re.search(rf"^{re.escape(heading)}\n.*?(?=^#|\Z)", text, re.DOTALL | re.MULTILINE)
        begin, end = found.span() if found else (len(text), len(text))
        before = text[:begin].rstrip("\n") + "\n\n" if text[:begin].strip() else ""
        text = before + section + text[end:]
    write_page(path, text.rstrip() + "\n")


@contextmanager
def picture(path: Path, rows: int = 1, columns: int = 1, size: tuple[float, float] = (5.0, 4.2)) -> Iterator[Any]:
    """Draw a picture: gives its axes, (rows, columns), and writes the file at the end. `size` is that of a panel."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for panel in axes.flat:
        panel.grid(alpha=0.3)
    yield axes
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=70)


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
    "out": {"type": Path, "help": "file to write; pictures and numbers go beside it"},
    "work": {"type": Path, "help": "folder of the runs; finished runs in it are not repeated"},
    "only_page": {"action": "store_true", "help": "run nothing; make the page from what is there"},
    "missing": {"action": "store_true", "help": "run only what the numbers do not have yet"},
}


def study_parser(description: str | None, **defaults: Any) -> argparse.ArgumentParser:
    """The command line of a study.

    Args:
        description: Docstring of the tool.
        defaults: The shared options that the study takes, by name in OPTIONS, with their default values. Where --out
            has a default, a folder is accepted too: it gets a file of the same name.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    for name, default in defaults.items():
        option = {**OPTIONS[name], "default": default}
        if name == "out" and default is not None:
            option["type"] = partial(_file_in, name=default.name)
        parser.add_argument("--" + name.replace("_", "-"), **option)
    return parser


def _file_in(text: str, name: str) -> Path:
    path = Path(text)
    return path if path.suffix == Path(name).suffix else path / name


def whole(result: Result) -> Result:
    """The result of a run, unless it was interrupted: numbers of a part of a run must not look like others.

    Raises:
        KeyboardInterrupt: if it was.
    """
    if result.status == STOPPED:
        raise KeyboardInterrupt
    return result


def run_tool(main: Callable[[], object]) -> None:
    """Run a tool. Wrong input, diverged and interrupted runs end it with one line and the exit code of `warp-pd`."""
    try:
        main()
    except KeyboardInterrupt:
        print(f"{Path(sys.argv[0]).name}: interrupted; what ended before is kept", file=sys.stderr)
        sys.exit(deadline.exit_code)
    except (InputError, DivergedError) as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        sys.exit(WRONG_INPUT if isinstance(error, InputError) else DIVERGED)
