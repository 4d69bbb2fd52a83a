"""The network in Torch: modules that do not fit, a user's module is left alone, memory, CUDA graphs."""

import gc
import resource

import numpy as np
import pytest
import torch
import warp as wp
from helpers import NEO, array, internal_force, refused, rough, square
from point_laws import build, exact_module, tiny

from warp_pd import Explicit, Fixed, Neural, Simulation


def test_modules_that_do_not_fit_are_refused():
    not_finite = torch.nn.Linear(4, 2)
    with torch.no_grad():
        not_finite.weight[0, 0] = float("nan")
    cases = [
        (torch.nn.Linear(3, 2), r"^network = Linear: expected a callable .* raised for shape \(2, 4\): "),
        (torch.nn.Linear(4, 3), r"^network = Linear: .*a callable.*returned \(2, 3\)$"),
        (lambda features: None, "^network = <lambda>: .*a callable.*returned NoneType$"),
        (not_finite, "^network = Linear: its output for .* is not finite; .*finite weights$"),
    ]
    for module, said in cases:
        with refused(match=said):
            build(square(5), Neural(NEO, network=module))


def test_a_function_serves_as_the_network_and_its_module_is_left_alone():
    sheet = square(9)
    module = exact_module()
    module.unused = torch.nn.Parameter(torch.ones(1, dtype=torch.float32))
    from_module = internal_force(build(sheet, Neural(NEO, network=module)), rough(sheet))
    from_function = internal_force(build(sheet, Neural(NEO, network=exact_module().forward)), rough(sheet))
    assert (from_module == from_function).all()
    assert module.unused.dtype == torch.float32


def test_many_steps_record_no_gradients_and_hold_no_memory():
    module = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.Tanh(), torch.nn.Linear(8, 2))
    built = build(square(13), Neural(NEO, network=module))
    sequence = built.context.sequence("step", repeat=10)
    step = next(launch for launch in built.context.stages["step"] if launch.name == "network").function
    assert any(p.requires_grad for p in step.function.parameters())

    def tensors():
        gc.collect()
        return sum(isinstance(o, torch.Tensor) for o in gc.get_objects())

    for _ in range(2):
        sequence.run()
    before, peak = tensors(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(15):
        sequence.run()
    assert tensors() == before
    # The graph of one step alone would hold 4 * 10^4 numbers; all of them 0.045 GB.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 20_000
    assert not step.pairs.requires_grad and step.pairs.grad_fn is None
    assert step.pairs.data_ptr() == array(built, "bond_pairs").ptr


@pytest.mark.gpu
def test_the_network_in_a_graph_on_cuda():
    """Torch's part is captured with Warp's: ten steps in one replay give what ten single ones do, and the CPU."""
    wp.init()
    if not wp.is_cuda_available():
        pytest.skip("no CUDA device")
    sheet = square(13)
    parts = {"loads": [Fixed(sheet.edges("all"))], "initial_displacement": rough(sheet, size=0.02)}
    for evaluation in ("torch", "fused"):
        for precision in (32, 64):
            law = Neural(NEO, evaluation=evaluation, network=tiny())
            ended = []
            for device, repeat in (("cpu", 1), ("cuda:0", 1), ("cuda:0", 10)):
                built = build(sheet, law, precision, device, **parts)
                built.state.step.assign(np.array([1e-5], built.state.step.numpy().dtype))
                sequence = built.context.sequence("step", repeat=repeat)
                for _ in range(20 // repeat):
                    sequence.run()
                ended.append(built.to_numpy(built.state.velocity))
            assert (ended[1] == ended[2]).all()
            scale = np.abs(ended[0]).max()
            assert np.abs(ended[0] - ended[1]).max() < (1e-10 if precision == 64 else 1e-3) * scale


def test_networks_of_users_are_told_apart_by_what_they_give():
    def fingerprint(scale):
        law = Neural(NEO, network=lambda features: scale * features[:, :2])
        return Simulation(square(9), force=law, solver=Explicit(0.02)).build("cpu").law.fingerprint()

    assert fingerprint(1.0) == fingerprint(1.0) != fingerprint(1.5)
