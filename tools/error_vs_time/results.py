"""The numbers of the runs, kept in a file per device."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from warp_pd.run.folder import write_atomically

from .studies import Configuration


@dataclass(frozen=True)
class Row:
    """What a run gave.

    Attributes:
        case: The run.
        status: How it ended.
        scalar: Relative error of the scalar; None where the run failed.
        field: Relative error of the field; None where the run failed.
        seconds: Median time of the run.
        spread: Range of the times over their median.
        setup: Time before the first step [s].
        compile: Compilation [s].
        point_steps: Points times force evaluations.
        device: Name of the device.
        made: Device, date and commit.
    """

    case: Configuration
    status: str
    scalar: float | None
    field: float | None
    seconds: float
    spread: float
    setup: float
    compile: float
    point_steps: float
    device: str
    made: str


def load(folder: Path) -> list[Row]:
    """Rows of all devices."""
    return [_row(item) for path in sorted(folder.glob("*.json")) for item in json.loads(path.read_text())]


def _row(item: dict) -> Row:
    # Files of 2026-11-21 and before call it "stand".
    made = item.pop("stand", None) or item.pop("made")
    return Row(**{**item, "case": Configuration(**item["case"]), "made": made})


def save(folder: Path, rows: Sequence[Row]) -> None:
    """Add or replace rows in the files of their devices."""
    folder.mkdir(parents=True, exist_ok=True)
    known = {(row.device, row.case): row for row in [*load(folder), *rows]}
    for device in {row.device for row in rows}:
        mine = [asdict(row) for (where, _), row in known.items() if where == device]
        name = "".join(c if c.isalnum() else "-" for c in device.lower()).strip("-")
        write_atomically(folder / f"{name}.json", json.dumps(mine, indent=1) + "\n")
