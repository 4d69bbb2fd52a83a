"""What the tools share: where a committed result comes from (device, date, commit), and wrong input in a line."""

import argparse
import datetime
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from warp_pd.checks import InputError
from warp_pd.device.context import find_device


def commit() -> str:
    """Short hash of the commit that this tree stands on, or "unknown" outside a repository."""
    here = Path(__file__).resolve().parent
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=here, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "unknown"


def stamp(device: str, stand: str | None = None) -> str:
    """Text like "on DEVICE, DATE, commit HASH"; `stand` names the commit where there is no repository."""
    return f"on {device}, {datetime.date.today()}, commit {stand or commit()}"


def device_name(value: str) -> str:
    """Type of the option --device: the name itself, refused in one line where there is no such device."""
    try:
        find_device(value)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return value


def one_line(main: Callable[[], None]) -> None:
    """Run a tool; wrong input ends with one line and exit code 2."""
    try:
        main()
    except InputError as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        sys.exit(2)
