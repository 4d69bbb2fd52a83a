"""Numbers for JSON, which knows neither NaN nor infinity."""

from __future__ import annotations

import math
from typing import Any


def finite_values(value: Any) -> Any:
    """Convert a value for JSON: NaN and infinity become None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite_values(item) for key, item in value.items()}
    return [finite_values(item) for item in value] if isinstance(value, list | tuple) else value
