"""Verdicts: what a case found of a law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STABLE, SMALLER, CLEAN, WRONG, NONE = (
    "stable", "stable with a smaller step", "diverges cleanly", "wrong", "does not apply",
)  # fmt: skip
# Units of a number that is not what its row says: largest kinetic energy over the available energy, for laws without
# an energy, and gain of energy, for viscous laws.
KINETIC, GAIN = "k = ", "gain "


class NotApplicableError(Exception):
    """The case does not apply to the law; the message says why."""


@dataclass(frozen=True, eq=False)
class Finding:
    """What a case found of a law, in one precision.

    Attributes:
        verdict: One of the five.
        number: The number behind it, or None.
        remark: What else there is to say.
        field: What float32 and float64 are compared by; None takes the number.
        unit: Unit of the number, if it differs from that of the row: KINETIC or GAIN.
    """

    verdict: str
    number: float | None = None
    remark: str = ""
    field: np.ndarray | None = None
    unit: str = ""


def short(number: float) -> str:
    """A number in three digits, such as 0.25, 1e6 or 1.5e-7."""
    return (
        f"{number:{'.3g' if number < 1e4 else '.2e'}}".replace(".00e", "e")
        .replace("0e", "e")
        .replace("e-0", "e-")
        .replace("e+0", "e")
        .replace("e+", "e")
    )


def two_digits(number: float) -> str:
    """A number in two digits."""
    return short(float(f"{number:.2g}"))


def step_count(steps: int) -> str:
    """Text like "1e6 steps"."""
    return f"{two_digits(steps)} steps"
