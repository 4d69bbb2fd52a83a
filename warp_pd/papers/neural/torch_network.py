"""Networks of the neural law as Torch modules."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from ...device.checks import InputError
from .networks import OUTPUTS, Network, PlainNetwork


def torch_module(network: Network) -> Any:
    """The network as a float64 torch.nn.Module from (lambda, theta, C33, det F), (B, 4), to T, (B, 2)."""
    return bond_network(plain_module(network))


def plain_module(network: Network | PlainNetwork) -> Any:
    """The layers of a network as a float64 torch.nn.Module; of a plain one, from (lambda, theta, C33, det F) to T."""
    layers: list[Any] = []
    for w, b in network.folded():
        layers += [_linear(w, b), torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


def _linear(w: np.ndarray, b: np.ndarray) -> Any:
    layer = torch.nn.Linear(w.shape[1], w.shape[0], dtype=torch.float64)
    with torch.no_grad():
        layer.weight.copy_(torch.from_numpy(w))
        layer.bias.copy_(torch.from_numpy(b))
    return layer


def bond_network(layers: Any) -> Any:
    """A torch.nn.Module that wraps `layers`, from q (B, 4) to o (B, 2), with the inputs and outputs of a Network."""

    class BondNetwork(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.layers = layers

        def forward(self, features: Any) -> Any:
            stretch, angle, c33, det = features.unbind(1)
            area = det.log()
            q = torch.stack([stretch.log(), angle * angle, area, c33.log() + 2.0 * area], 1)
            out = self.layers(q)
            return torch.stack([out[:, 0], angle * out[:, 1]], 1)

    return BondNetwork()


def check_network(function: Callable[[Any], Any], torch_dtype: Any, device: Any) -> None:
    """Check a user's callable on an undeformed and a stretched bond."""
    name = getattr(function, "__name__", type(function).__name__)
    rows = [[1.0, 0.0, 1.0, 1.0], [1.1, 0.05, 0.8, 1.12]]
    trial = torch.tensor(rows, dtype=torch_dtype, device=device)
    with torch.no_grad():
        try:
            out = function(trial)
        except (RuntimeError, ValueError, TypeError, IndexError) as error:
            reason = str(error).splitlines()[0]
            raise InputError(
                f"network = {name}: expected a callable from a tensor (bonds, 4) to one (bonds, 2); this one "
                f"raised for shape (2, 4): {reason}"
            ) from None
    if not torch.is_tensor(out) or tuple(out.shape) != (2, OUTPUTS):
        shape = tuple(out.shape) if torch.is_tensor(out) else type(out).__name__
        raise InputError(
            f"network = {name}: expected a callable from a tensor (bonds, 4) to one (bonds, 2); this one returned "
            f"{shape}"
        )
    if not bool(torch.isfinite(out).all()):
        raise InputError(f"network = {name}: its output for an undeformed bond is not finite; expected finite weights")
