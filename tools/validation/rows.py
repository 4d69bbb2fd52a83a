"""All rows, by name, in the order of the page."""

from __future__ import annotations

from validation import bulges, cracks, relaxation, tears
from validation.comparison import Comparison

ROWS = {
    made.name: made for made in (make() for make in (*bulges.ROWS, *relaxation.ROWS, *tears.ROWS, *cracks.ROWS))
}  # fmt: skip
NAMES = tuple(ROWS)


def row(name: str) -> Comparison:
    """The row of a name."""
    return ROWS[name]
