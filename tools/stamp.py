"""Where a committed result comes from: device, date and commit."""

import datetime
import subprocess
from pathlib import Path


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
