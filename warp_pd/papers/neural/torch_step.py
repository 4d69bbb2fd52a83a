"""Evaluation of the neural law's network in Torch, on arrays shared with Warp."""

from __future__ import annotations

import contextlib
import copy
import hashlib
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
import warp as wp

from ...device.checks import InputError
from ...device.cores import no_collection
from ...device.fields import Array
from .networks import Network
from .torch_network import check_network, torch_module

# Bonds that Torch takes at once on a CPU.
CACHED_ROWS = 8192
_graphs: weakref.WeakSet[Any] = weakref.WeakSet()


class TorchStep:
    """Evaluates the network on features written by a Warp kernel; another kernel reads the resulting pairs."""

    def __init__(self, loaded: Network | None, network: Any, features: Array, pairs: Array) -> None:
        """Share the arrays with Torch.

        Args:
            loaded: A Network, or None.
            network: Any callable, used if `loaded` is None.
            features: (lambda, theta, C33, det F) of each bond, (bonds,) vec4.
            pairs: Force along and across each bond divided by mu, (bonds,) vec2.

        Raises:
            InputError: if the callable has the wrong signature, or Torch has no CUDA on a GPU.
        """
        assert features.device is not None
        self.device = features.device
        if self.device.is_cuda and not torch.cuda.is_available():
            raise InputError(
                f"evaluation = 'torch': expected a build of Torch with CUDA on {self.device.alias}, got "
                f"{torch.__version__} without it; or use 'fused' or 'closed_form'"
            )
        # Zero copy: the tensors are views of Warp's arrays.
        self.features, self.pairs = wp.to_torch(features), wp.to_torch(pairs)
        given: Any = torch_module(loaded) if loaded is not None else network
        if isinstance(given, torch.nn.Module):
            given = copy.deepcopy(given).to(device=self.features.device, dtype=self.features.dtype).eval()
        check_network(given, self.features.dtype, self.features.device)
        self.function: Callable[[Any], Any] = given

    def __call__(self) -> None:
        """Evaluate all bonds, on Warp's stream."""
        # On a CPU in pieces that stay in its cache: three times as fast.
        rows = len(self.features) if self.device.is_cuda else CACHED_ROWS
        with self._stream(), torch.no_grad():
            for features, pairs in zip(self.features.split(rows), self.pairs.split(rows), strict=True):
                pairs.copy_(self.function(features))

    def fingerprint(self) -> str:
        """A hash of the network's outputs for some bonds."""
        rows = torch.linspace(0.8, 1.3, 4 * 64, dtype=self.features.dtype).reshape(64, 4).to(self.features.device)
        with self._stream(), torch.no_grad():
            found = self.function(rows).cpu().numpy()
        return hashlib.sha1(np.ascontiguousarray(found).tobytes()).hexdigest()[:12]

    def _stream(self) -> Any:
        """Context in which Torch uses Warp's current stream, also during a graph capture."""
        if not self.device.is_cuda:
            return contextlib.nullcontext()
        return torch.cuda.stream(wp.stream_to_torch(wp.get_stream(self.device)))


def capture(device: wp.Device, warm_up: Callable[[], None], body: Callable[[], None]) -> Callable[[], None]:
    """Capture `body`, launches and calls, in a CUDA graph of Torch, whose memory pool owns the temporaries; its replay.

    `warm_up` runs the calls once. The replay runs on Warp's stream, in order with other work.
    """
    # Torch allocates and chooses its algorithms on the first call, which no capture allows.
    warm_up()
    wp.synchronize_device(device)
    stream: Any = torch.cuda.Stream(device=wp.device_to_torch(device))
    graph = torch.cuda.CUDAGraph()
    _graphs.add(graph)
    with no_collection(), wp.ScopedStream(wp.stream_from_torch(stream)), torch.cuda.graph(graph, stream=stream):
        wp.capture_begin(device=device, force_module_load=False, external=True)
        try:
            body()
        finally:
            wp.capture_end(device=device)

    def replay() -> None:
        with torch.cuda.stream(wp.stream_to_torch(device.stream)):
            graph.replay()

    return replay


def release_graphs() -> None:
    """Free all graphs captured by `capture`, at the end of a process."""
    for graph in list(_graphs):
        graph.reset()
