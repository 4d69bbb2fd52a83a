"""The file of numbers: an example a line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from warp_pd.output.info import finite_values
from warp_pd.run.folder import write_atomically


def load(path: Path) -> dict[str, Any]:
    """Examples of earlier calls, by key; none if there is no file."""
    return json.loads(path.read_text("utf-8")) if path.is_file() else {}


def save(path: Path, found: Mapping[str, Any]) -> None:
    """Write all examples, sorted by key, with six digits."""
    lines = [f"{json.dumps(key)}: {json.dumps(finite_values(_short(found[key])))}" for key in sorted(found)]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, "{\n" + ",\n".join(lines) + "\n}\n")


def _short(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _short(entry) for key, entry in value.items()}
    return float(f"{float(value):.6g}") if not isinstance(value, str | int | None) else value
