"""Progress display: a bar in a notebook or terminal, occasional lines elsewhere."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterator
from time import perf_counter
from typing import Any

from ..interfaces import FrameReport
from ..interfaces.frame import Surface
from .notebook import has_widgets, in_notebook

# Seconds left that are worth a line, and between two lines.
LONG, SECONDS_SAID = 60.0, 30.0


def duration_text(seconds: float) -> str:
    """A duration in words, such as "12 min"."""
    for size, unit in ((86400.0 * 365.25, "years"), (86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.0f} s"


class Progress:
    """Shows simulated time (or load factor), step rate, energy balance and remaining time on stderr.

    Args:
        quiet: Whether to show only notes.

    Attributes:
        noted: Notes shown so far.
    """

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet
        self.noted: list[str] = []
        self._bar: Any = None
        self._rounds = 0
        # Percent at the last frame, and from one frame to the next.
        self._reached, self._step = 0.0, 100.0
        self._said_at = -math.inf

    def begin(self, headline: str) -> None:
        """Print the headline before the kernels are compiled."""
        self._say(headline)
        self._say("compiling kernels (only the first time; later they come from Warp's cache) ...")

    def compiled(self, seconds: float) -> None:
        """Print the compilation time and open the bar."""
        self._say(f"kernels ready after {seconds:.1f} s")
        if self.quiet:
            return
        with self._may_be_lost():
            self._bar = self._new_bar()

    def shows(self, surface: Surface) -> None:
        """Receive what is common to all frames, before the first one."""

    def stops(self) -> None:
        """The user asked to stop."""

    def _new_bar(self) -> Any:
        bar, width = _bar_class()
        return bar(
            total=100.0,
            file=sys.stderr,
            disable=not (sys.stderr.isatty() or in_notebook()),
            # What matters least comes last: a narrow terminal cuts it off.
            bar_format="{percentage:3.0f}%|" + width + "| {elapsed}<{remaining}  {desc}",
        )

    def say(self, *lines: str) -> None:
        """Print lines, such as the step of a run."""
        for line in lines:
            self._say(line)

    def note(self, *lines: str) -> None:
        """Print notes on the run, also if quiet."""
        self.noted += lines
        for line in lines:
            self._print(line)

    def between(self, fraction: float, when: str, rate: float, left: float) -> None:
        """Show the progress between frames: time, steps per second, and seconds left.

        Where there is no bar, a line is printed only if a minute is left, at first and then twice a minute.
        """
        if self._bar is None:
            return
        text = f"{when}, {rate:.0f} steps/s, {duration_text(left)} left"
        if not self._bar.disable:
            self._show(100.0 * fraction, text, every=1)
        elif left > LONG and perf_counter() >= self._said_at + SECONDS_SAID:
            self._said_at = perf_counter()
            self._say(f"{100.0 * fraction:5.1f} %  {text}")

    def frame(self, report: FrameReport) -> None:
        """Show the progress and the energy balance at a frame."""
        row, text = report.row, f"{report.when}, {report.steps_per_second:.0f} steps/s"
        if "balance_error" in row:
            text += f", balance {100.0 * row['balance_error']:+.2f} %"
        if "largest_damage" in row:
            text += f", damage {row['largest_damage']:.2f}"
        self._reached, self._step = 100.0 * report.fraction, 100.0 / max(1, report.frames)
        self._show(self._reached, text, every=max(1, report.frames // 10))

    def residual(self, steps: int, residual: float, tolerance: float, round_of: str) -> None:
        """Show the residual of a static run; its decades lead the bar on to the next frame."""
        percent = self._reached
        if math.isfinite(residual) and residual > 0.0:
            percent += self._step * min(1.0, max(0.0, math.log(residual) / math.log(tolerance)))
        text = f"step {steps}, residual {residual:.2e} (goal {tolerance:.0e})"
        if round_of:
            text = f"{text}, {round_of}"
        self._show(min(percent, 99.9), text, every=10)

    def close(self) -> None:
        """Close the bar, leaving it visible."""
        if self._bar is not None:
            with self._may_be_lost():
                self._bar.close()

    def _show(self, percent: float, text: str, every: int) -> None:
        if self.quiet or self._bar is None:
            return
        if self._bar.disable:
            if self._rounds % every == 0 or percent >= 100.0:
                self._say(f"{percent:5.1f} %  {text}")
            self._rounds += 1
            return
        with self._may_be_lost():
            self._bar.n = round(percent, 1)
            self._bar.set_description_str(text)

    def _say(self, line: str) -> None:
        if not self.quiet:
            self._print(line)

    def _print(self, line: str) -> None:
        with self._may_be_lost():
            print(line, file=sys.stderr, flush=True)

    @contextlib.contextmanager
    def _may_be_lost(self) -> Iterator[None]:
        """Context in which a terminal or a log that is gone ends the progress, and not the run."""
        try:
            yield
        except (OSError, ValueError, AttributeError):
            self.quiet, self._bar = True, None


def _bar_class() -> tuple[Any, str]:
    """The progress bar class (notebook widget or terminal) and the format of its width."""
    if in_notebook() and has_widgets():
        from tqdm.notebook import tqdm as of_notebook

        return of_notebook, "{bar}"
    from tqdm import tqdm

    return tqdm, "{bar:6}"
