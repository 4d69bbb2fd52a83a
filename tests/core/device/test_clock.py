"""The clock: schedules on the device, now and a step later."""

import numpy as np
import pytest
from helpers import build, square

from warp_pd import Explicit, Motion, Pressure
from warp_pd.device.graph import run_once


def test_schedules_are_known_a_step_ahead():
    """Each clock gives what linear interpolation does: now, and a step later."""
    sheet = square(7)
    times, places = [0.0, 1e-4, 3e-4, 4e-4], [0.0, 0.02, -0.01, 0.01]
    loads = [Motion(sheet.edges("right"), times, x=places), Pressure(1.0, ramp=[(0.0, 0.5), (2e-4, 1.0)])]
    built = build(sheet, loads=loads, solver=Explicit(1.0))
    clock = built.context.clock
    known = {tuple(times): places, (0.0, 2e-4): [0.5, 1.0]}
    paths = [(x.times, known[tuple(x.times)]) for x in clock.schedules]
    assert len(paths) == len(known) == 2
    clock.advance.assign(np.array([3e-5, 3.5e-4]))
    built.context.run("clock")
    for step in range(15):
        now, soon = (min(k * 3e-5, 3.5e-4) for k in (step, step + 1))
        wanted = [np.interp(t, x, y) for t in (now, soon) for x, y in paths]
        assert clock.scheduled.numpy()[:, 0] == pytest.approx(wanted, abs=1e-12)
        run_once(built.context.device, [x for x in built.context.stages["step"] if x.name == "tick"])
