"""A network of a user's own in the step: on a GPU its module is captured in the graph of the step."""

import numpy as np
import pytest
from helpers import NEO, rough, square
from point_laws import build, exact_module

from warp_pd import Fixed, Neural, Newton, Pressure, Simulation, TearingEnergy

torch = pytest.importorskip("torch")


def branches(scale=1e-2):
    """A module unlike those of the package: two branches, a buffer, an activation that saturates nowhere."""

    class Branches(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.exact = exact_module()
            self.wide, self.narrow = torch.nn.Linear(4, 16), torch.nn.Linear(16, 2)
            self.register_buffer("rest", torch.tensor([1.0, 0.0, 1.0, 1.0]))

        def forward(self, features):
            more = self.narrow(torch.nn.functional.silu(self.wide(features - self.rest)))
            return self.exact(features) + scale * (more - self.narrow(torch.nn.functional.silu(self.wide.bias)))

    torch.manual_seed(0)
    return Branches()


def velocity(law, device, precision, repeat, **parts):
    """Velocity after twenty steps of a held, rough sheet, `repeat` of them in one replay."""
    sheet = square(13)
    start = {"loads": [Fixed(sheet.edges("all"))], "initial_displacement": rough(sheet, size=0.02)}
    built = build(sheet, law, precision, device, **start, **parts)
    built.state.step.assign(np.array([1e-5], built.state.step.numpy().dtype))
    sequence = built.context.sequence("step", repeat=repeat)
    for _ in range(20 // repeat):
        sequence.run()
    return built.to_numpy(built.state.velocity)


@pytest.mark.parametrize("precision", [64, 32])
@pytest.mark.parametrize("torn", [False, True], ids=["whole", "damage field"])
def test_a_module_of_a_user_steps_as_on_a_cpu_and_as_the_closed_form(device, torn, precision):
    parts = {"damage": TearingEnergy(50.0)} if torn else {}
    exact = Neural(NEO, evaluation="closed_form")
    for module, other, other_device in ((exact_module(), exact, device), (branches(), None, "cpu")):
        law = Neural(NEO, network=module)
        one, ten = (velocity(law, device, precision, repeat, **parts) for repeat in (1, 10))
        assert (one == ten).all()
        wanted = velocity(other or law, other_device, precision, 1, **parts)
        assert np.abs(one - wanted).max() < (1e-9 if precision == 64 else 2e-3) * np.abs(wanted).max()


@pytest.mark.parametrize("precision", [64, 32])
def test_newton_takes_a_module_of_a_user(device, precision):
    sheet, found = square(9), []
    for law, on in (
        (Neural(NEO, 2.015, network=exact_module()), device),
        (Neural(NEO, 2.015, evaluation="closed_form"), "cpu"),
    ):
        loads = [Fixed(sheet.edges("all")), Pressure(5.0)]
        result = Simulation(sheet, law, Newton(), loads=loads).run(device=on, precision=precision)
        assert result.status == "finished"
        found.append(result.frame.displacement)
    assert np.abs(found[0] - found[1]).max() < (1e-7 if precision == 64 else 1e-3) * np.abs(found[1]).max()
