"""The neural force law of the NN paper, and its closed form."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bonds import InfluenceFunction, influence_function
from ..checks import InputError, one_of, positive
from ..launches import Workspace
from ..materials import Material, check_material
from ..sheet import Sheet
from . import network as networks
from .network import Network
from .nodal import WholeFamilyForce

if TYPE_CHECKING:
    from ..kernels.neural import NeuralKernels

# Bonds that Torch takes at once on a CPU.
CACHED_ROWS = 8192
EVALUATIONS = ("torch", "fused", "closed_form")
# Weights of a network that become numbers in a kernel; more compile slowly.
MOST_WEIGHTS = 10_000


@dataclass(frozen=True)
class Neural:
    """Bond forces from the bond's own stretch and rotation, with the family's C33 and det F (NN section 4.2).

    In place of the stress of its family, each bond answers to its own image. That removes the zero-energy modes of
    `Nodal`, without a deformation gradient for every bond. There is no potential: the force is not the gradient of
    any energy, so runs report no strain energy and no balance.

    Attributes:
        material: A hyperelastic material with `membrane` and `ratios`, such as NeoHookean or Gent.
        horizon: Horizon over the spacing of the sheet [-].
        evaluation: How the map from bond to force is evaluated:
            "torch": by `network` in Torch, on all bonds at once.
            "fused": by the same network inside one Warp kernel, its weights numbers in the code.
            "closed_form": exactly (kernels/neural.py), without a network.
        network: A Network, the file of one, or None for the one that comes with the package. For "torch" also
            any callable, a torch.nn.Module for instance, from a tensor (bonds, 4) of (lambda, theta, C33, det F) to
            one (bonds, 2) of the force over mu along and across the bond. A module is copied and cast to the
            precision and device of the run; any other callable gets tensors of theirs. It runs without gradients;
            on CUDA it is captured in a graph, so it must not look at values on the host.
        influence: Influence function of r = |X| / horizon, as in `BondAssociated`; the paper's is "inverse".

    Raises:
        InputError: for a network that is missing, damaged, made for another material, or too large for "fused".
    """

    material: Material
    horizon: float = 3.15
    evaluation: str = "torch"
    network: Network | Callable[[Any], Any] | str | Path | None = None
    influence: str | InfluenceFunction = "inverse"
    loaded: Network | None = field(init=False, default=None)

    weights = "point"
    has_energy = False
    has_tangent = False

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        influence_function(self.influence)
        check_material(self.material, "functions")
        one_of("evaluation", self.evaluation, EVALUATIONS)
        if not hasattr(self.material, "membrane"):
            raise InputError(
                f"material = {type(self.material).__name__}: allowed with the neural law are materials with "
                f"`membrane` and `ratios`, such as NeoHookean and Gent"
            )
        if self.evaluation == "closed_form":
            if self.network is not None:
                raise InputError("network: allowed with evaluation 'closed_form' is None")
        elif self.network is None or isinstance(self.network, str | Path | Network):
            object.__setattr__(self, "loaded", self._load())
        elif not callable(self.network):
            raise InputError(f"network = {self.network!r}: allowed are a Network, a file, a callable or None")
        elif self.evaluation == "fused":
            raise InputError("network: allowed with evaluation 'fused' are a Network, a file or None")

    def _load(self) -> Network:
        name = "the default" if self.network is None else str(self.network)
        if isinstance(self.network, Network):
            name = "given"
            networks.require_sound(self.network, "network")
            found = self.network
        else:
            found = networks.default() if self.network is None else networks.load(name)
        found.require_material(self.material, name)
        if self.evaluation == "fused" and found.size > MOST_WEIGHTS:
            raise InputError(
                f"network = {name!r} has {found.size} weights: allowed with evaluation 'fused' are at most "
                f"{MOST_WEIGHTS}; take 'torch'"
            )
        return found

    def signature(self, layout: str, breakable: bool) -> tuple[Any, ...]:
        """What decides which kernels are compiled."""
        numbers = self.loaded.sigmoids() if self.loaded is not None and self.evaluation == "fused" else None
        counted = self.loaded is not None
        return (layout, "neural", self.material.membrane, breakable, self.evaluation, numbers, counted)  # type: ignore[attr-defined]

    def build(self, workspace: Workspace, sheet: Sheet, breakable: bool) -> NeuralForce:
        """Families and tables on the device.

        Raises:
            InputError: for a horizon that the sheet does not allow, a callable that does not fit, or "torch" where
                there is no torch.
        """
        return NeuralForce(self, workspace, sheet, breakable)


class NeuralForce(WholeFamilyForce):
    """The law on one sheet and device.

    Attributes:
        outside: Bonds of each point outside the training range when last counted, int32, shape (N,), or None.
    """

    has_energy = False

    def __init__(self, law: Neural, workspace: Workspace, sheet: Sheet, breakable: bool) -> None:
        import warp as wp

        from ..kernels.neural import neural

        super().__init__("Neural", law, workspace, sheet, breakable)
        layout, bits, module = self.families.layout, workspace.bits, workspace.module
        layers, fused_module = None, f"{module}_fused"
        if law.evaluation == "fused":
            assert law.loaded is not None
            layers = law.loaded.sigmoids()
            workspace.use_fast_math(fused_module)
        self.kernels: NeuralKernels = neural(
            layout,
            bits,
            law.material.membrane,  # type: ignore[attr-defined]
            breakable,
            law.evaluation,
            layers,
            law.loaded is not None,
            module,
            fused_module,
        )
        self.outside = None
        if law.loaded is not None:
            self.outside = workspace.array("outside_range", self.owner, wp.int32, shape=sheet.size)
        if law.evaluation == "torch":
            slots = self.families.members * sheet.size
            self._features = workspace.array("features", self.owner, self.types.parameters, shape=slots)
            self._pairs = workspace.array("bond_pairs", self.owner, self.types.vec2, shape=slots)
            self._frame = workspace.array("frame", self.owner, self.types.mat32, shape=sheet.size)
            self._infer = TorchStep(law, self._features, self._pairs)

    def add_force(self, stage: str, displacement: Any, force: Any) -> None:
        """Add the launches that turn a displacement [m] into the internal force [N], both (N,) vec3."""
        w, kernels = self.workspace, self.kernels
        shared = self.family_arguments(displacement)
        unit_force = self.unit_volume * self.inverse_horizon
        if self.law.evaluation == "torch":
            w.launch(
                stage, self.owner, kernels.features, self.points,
                **shared, constants=self.constants, points=self.points, features=self._features, frame=self._frame,
            )  # fmt: skip
            w.call(stage, self.owner, "network", len(self._features), self._infer)
            w.launch(
                stage, self.owner, kernels.spread, self.points,
                **shared, frame=self._frame, pairs=self._pairs, unit_force=self.law.material.mu * unit_force,
                points=self.points, bond_force=self.bond_force,
            )  # fmt: skip
        else:
            # A network gives forces over mu.
            scale = self.law.material.mu if self.law.evaluation == "fused" else 1.0
            w.launch(
                stage, self.owner, kernels.direct, self.points,
                **shared, constants=self.constants, unit_force=scale * unit_force, bond_force=self.bond_force,
            )  # fmt: skip
        self.add_gather(stage, self.bond_force, force)

    def add_count(self, stage: str, displacement: Any) -> None:
        """Add the launch that counts bonds outside the training range; none if there is no known range."""
        if self.outside is None:
            return
        least, most = self.law.loaded.stretches
        self.workspace.launch(
            stage, self.owner, self.kernels.outside, self.points,
            **self.family_arguments(displacement), constants=self.constants, least=least, most=most, out=self.outside,
        )  # fmt: skip


class TorchStep:
    """Runs the network on features that a Warp kernel wrote, into pairs that another one reads."""

    def __init__(self, law: Neural, features: Any, pairs: Any) -> None:
        import warp as wp

        try:
            import torch
        except ImportError:
            raise InputError(
                "evaluation = 'torch': allowed where torch is installed (pip install 'warp-pd[neural]'); "
                "take 'fused' or 'closed_form'"
            ) from None
        self.device = features.device
        if self.device.is_cuda and not torch.cuda.is_available():
            raise InputError(
                f"evaluation = 'torch': allowed on {self.device.alias} with a torch that has CUDA, this is "
                f"{torch.__version__}; take 'fused' or 'closed_form'"
            )
        # Zero copy: the tensors are views of Warp's arrays.
        self.features, self.pairs = wp.to_torch(features), wp.to_torch(pairs)
        given: Any = networks.torch_module(law.loaded) if law.loaded is not None else law.network
        if isinstance(given, torch.nn.Module):
            given = copy.deepcopy(given).to(device=self.features.device, dtype=self.features.dtype).eval()
        networks.checked(given, self.features.dtype, self.features.device)
        self.function: Callable[[Any], Any] = given

    def __call__(self) -> None:
        """Evaluate all bonds, on Warp's stream."""
        import torch

        # On a CPU in pieces that stay in its cache: three times as fast.
        rows = len(self.features) if self.device.is_cuda else CACHED_ROWS
        with self._stream(), torch.no_grad():
            for features, pairs in zip(self.features.split(rows), self.pairs.split(rows), strict=True):
                pairs.copy_(self.function(features))

    def _stream(self) -> Any:
        """Torch on the stream that Warp works on now, that of a capture included."""
        import torch
        import warp as wp

        if not self.device.is_cuda:
            return contextlib.nullcontext()
        return torch.cuda.stream(wp.stream_to_torch(wp.get_stream(self.device)))


def outside_count(force: Any) -> int:
    """Bonds outside the training range when last counted."""
    return int(np.sum(force.outside.numpy()))
