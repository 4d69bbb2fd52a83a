"""Progress on the terminal: a bar where there is a terminal, one line a frame now and then elsewhere."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from ..frame import moment

if TYPE_CHECKING:
    from ..runner import Recorder
    from ..simulation import Built


class Progress:
    """Shows simulated time (at rest the share of the load), step rate, energy balance and time left, on stderr.

    Args:
        quiet: Show nothing.
    """

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet
        self._bar: Any = None
        self._rounds = 0

    def begin(self, built: Built) -> None:
        """Say what runs where, before the kernels are compiled."""
        s = built.simulation
        self._say(
            f"{s.scene}: {s.sheet.size} points, {built.force.families.bond_count} bonds, horizon {s.force.horizon:g} "
            f"spacings, {built.force.weights} weights, float{built.types.bits}, on {built.workspace.device.name}"
        )
        self._say("compiling kernels (only the first time; then they come from Warp's cache) ...")

    def compiled(self, seconds: float) -> None:
        """Say how long compilation took, and open the bar."""
        self._say(f"kernels ready after {seconds:.1f} s")
        if self.quiet:
            return
        self._bar = tqdm(
            total=100.0,
            file=sys.stderr,
            disable=None if sys.stderr.isatty() else True,
            bar_format="{l_bar}{bar}| {postfix} [{elapsed}<{remaining}]",
        )

    def frame(self, recorder: Recorder) -> None:
        """A frame."""
        solver = recorder.built.simulation.solver
        share = 100.0 * min(1.0, recorder.time / solver.duration)
        row = recorder.history[-1]
        rate = recorder.steps / recorder.step_seconds if recorder.step_seconds > 0.0 else 0.0
        text = f"{moment(recorder.time, recorder.built.load_duration)}, {rate:.0f} steps/s"
        if "balance_error" in row:
            text += f", energy balance {100.0 * row['balance_error']:+.2f} %"
        if "largest_damage" in row:
            text += f", damage {row['largest_damage']:.2f}"
        self._show(share, text, every=max(1, solver.frame_count // 10))

    def residual(self, steps: int, residual: float, tolerance: float) -> None:
        """A quasi-static run on its way: the share is that of the decades to go."""
        share = 0.0
        if math.isfinite(residual) and residual > 0.0:
            share = 100.0 * min(1.0, max(0.0, math.log(residual) / math.log(tolerance)))
        self._show(share, f"step {steps}, residual {residual:.2e} (goal {tolerance:.0e})", every=10)

    def close(self) -> None:
        """Leave the bar as it stands."""
        if self._bar is not None:
            self._bar.close()

    def _show(self, share: float, text: str, every: int) -> None:
        if self.quiet or self._bar is None:
            return
        if self._bar.disable:
            if self._rounds % every == 0 or share >= 100.0:
                self._say(f"{share:5.1f} %  {text}")
            self._rounds += 1
            return
        self._bar.n = round(share, 1)
        self._bar.set_postfix_str(text)

    def _say(self, line: str) -> None:
        if not self.quiet:
            print(line, file=sys.stderr, flush=True)
