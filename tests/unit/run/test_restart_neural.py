"""A restart of the neural law goes on bit for bit, with the same network alone."""

import numpy as np
import pytest
from helpers import NEO, StopAt, square
from point_laws import tiny

from warp_pd import Explicit, Fixed, InputError, Neural, Pressure, Simulation


def simulation(seed):
    sheet = square(9)
    solver = Explicit(duration=0.02, frames=4)
    loads = [Fixed(sheet.edges("all")), Pressure(5.0)]
    return Simulation(sheet, force=Neural(NEO, network=tiny(seed)), solver=solver, loads=loads)


def test_restart_goes_on_bit_for_bit_and_refuses_other_weights(tmp_path):
    options = {"device": "cpu", "precision": 64, "usd": False}
    complete = simulation(0).run(device="cpu", precision=64)
    interrupted = simulation(0).run(**options, out=tmp_path, writers=[StopAt(2)])
    assert interrupted.status == "interrupted"
    with pytest.raises(InputError, match="other settings"):
        simulation(1).run(**options, out=tmp_path, resume=True)
    resumed = simulation(0).run(**options, out=tmp_path, resume=True)
    assert resumed.status == "finished" and np.abs(complete.frame.displacement).max() > 0.0
    assert (resumed.frame.displacement == complete.frame.displacement).all()


def test_functions_of_users_are_told_apart_by_what_they_give():
    def fingerprint(scale):
        law = Neural(NEO, network=lambda features: scale * features[:, :2])
        return Simulation(square(9), force=law, solver=Explicit(0.02)).build("cpu").law.fingerprint()

    assert fingerprint(1.0) == fingerprint(1.0) != fingerprint(1.5)
