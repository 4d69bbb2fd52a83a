"""The neural force law of the NN paper, and its closed form."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ...context import Context
from ...device.checks import InputError, one_of, positive
from ...device.fields import Array
from ...device.launches import Call, Stage, Touched
from ...families import InfluenceFunction, influence_function
from ...interfaces import BuiltLaw, Columns, History
from ...interfaces.frame import format_time
from ...kernels.papers.bonds import BondLaw
from ...kernels.papers.neural import closed_form, closed_form_of_stress, neural
from ...kernels.papers.nodal import nodal
from ...laws.weight_tables import MAX_CORRECTED
from ...materials import Material, capabilities, check_material
from ...statics.tangent import Tangent, tangent_of
from ...step import Phase
from ..nodal import PointLaw
from . import networks
from .networks import Network

EVALUATIONS = ("torch", "fused", "closed_form")
WEIGHTS = ("auto", "published", "corrected")
# Maximum number of network weights that are compiled into a kernel as constants; more compile slowly.
MAX_WEIGHTS = 10_000
NO_TORCH = (
    "evaluation = 'torch': the package torch is not installed (pip install 'warp-pd[neural]'); or use 'fused' or "
    "'closed_form'"
)


@dataclass(frozen=True)
class Neural:
    """Bond forces from the bond's own stretch and rotation, with the family's C33 and det F (NN section 4.2).

    The force of a bond depends on its own deformation, not on the stress of its family. That removes the zero-energy
    modes of `Nodal` without a deformation gradient for every bond. The force has no potential, so runs report neither
    strain energy nor an energy balance. `TearingEnergy` takes the energy of the material at the gradient of a family.

    Attributes:
        material: A hyperelastic material. NeoHookean and Gent take C33 from the family, as the paper does; of others
            the closed form takes it from the bond's own stretch tensor, which is the same in uniform states.
        horizon: Horizon in spacings of the sheet [-].
        evaluation: How the map from bond to force is evaluated:
            "torch": by `network` in Torch, as one batch of all bonds.
            "fused": by the same network inside one Warp kernel, with its weights as compile-time constants.
            "closed_form": exactly (kernels/papers/neural.py), without a network.
        network: A Network, a network file, or None for the network of the package (neo-Hookean, K / mu = 100). For
            "torch" also any callable, such as a torch.nn.Module, that maps a tensor (bonds, 4) of (lambda, theta, C33,
            det F) to a tensor (bonds, 2) of the force along and across the bond divided by mu (by the shear modulus, of
            materials without mu), or the file of a `networks.PlainNetwork`. A module is copied and cast to the
            precision and device of the run; other callables get tensors of that precision and device. It runs without
            gradients. On CUDA it is captured in a graph, so it must not read values on the host.
        influence: Influence function of r = |X| / horizon, as in `BondAssociated`; the paper's is "inverse".
        weights: "published", 2 / tr K of each family (NN eq. 36), which treats families at edges as round; "corrected",
            one weight per bond, such that a uniform stress is in equilibrium up to the edges
            (`warp_pd.families.weights`); or "auto", which is "corrected", but "published" at horizons above 4.5 or if
            bonds can break.

    Raises:
        InputError: if the network is missing, damaged, trained for another material, or too large for "fused".
    """

    material: Material
    horizon: float = 3.15
    evaluation: str = "torch"
    network: Network | Callable[[Any], Any] | str | Path | None = None
    influence: str | InfluenceFunction = "inverse"
    weights: str = "auto"
    loaded: Network | None = field(init=False, default=None)

    has_energy: ClassVar[bool] = False
    has_tangent: ClassVar[bool] = True

    def __post_init__(self) -> None:
        positive("horizon", self.horizon)
        influence_function(self.influence)
        check_material(self.material, "functions")
        one_of("evaluation", self.evaluation, EVALUATIONS)
        one_of("weights", self.weights, WEIGHTS)
        if capabilities(self.material).volume is None:
            raise InputError(
                f"material = {type(self.material).__name__}: expected a material with a `volume`, with the law Neural"
            )
        if self.evaluation == "closed_form":
            if self.network is not None:
                raise InputError("network: expected None with evaluation 'closed_form'")
        elif isinstance(self.network, str | Path) and (plain := networks.plain(self.network)) is not None:
            object.__setattr__(self, "network", self._module(plain))
        elif self.network is None or isinstance(self.network, str | Path | Network):
            object.__setattr__(self, "loaded", self._load())
        elif not callable(self.network):
            raise InputError(f"network = {self.network!r}: expected a Network, a file, a callable or None")
        elif self.evaluation == "fused":
            raise InputError("network: expected a Network, a file or None with evaluation 'fused'")

    def _module(self, plain: networks.PlainNetwork) -> Any:
        if self.evaluation == "fused":
            raise InputError(f"network = {str(self.network)!r}: expected evaluation 'torch' with a plain network")
        try:
            from .torch_network import plain_module
        except ImportError:
            raise InputError(NO_TORCH) from None
        return plain_module(plain)

    def _load(self) -> Network:
        name = "the default" if self.network is None else str(self.network)
        if isinstance(self.network, Network):
            name = "given"
            networks.require_sound(self.network, "network")
            found = self.network
        else:
            found = networks.default() if self.network is None else networks.load(name)
        found.require_material(self.material, name)
        if self.evaluation == "fused" and found.size > MAX_WEIGHTS:
            raise InputError(
                f"network = {name!r}: expected at most {MAX_WEIGHTS} weights with evaluation 'fused', got "
                f"{found.size}; or use 'torch'"
            )
        return found

    def resolved_weights(self, breakable: bool) -> str:
        """The weights with "auto" resolved; `breakable` is whether bonds can break."""
        if self.weights != "auto":
            return self.weights
        return "published" if breakable or self.horizon > MAX_CORRECTED else "corrected"

    def build(self, context: Context) -> BuiltLaw:
        """Build the law.

        Raises:
            InputError: if the sheet does not allow the horizon, the callable has the wrong signature, or Torch is
                needed but not installed.
        """
        return NeuralForce(self, context)


class NeuralForce(PointLaw):
    """The law on one sheet and device.

    Attributes:
        outside: Number of bonds of each point outside the training range at the last count, int32, (N,), or None.
    """

    def __init__(self, law: Neural, context: Context) -> None:
        weights, known = law.resolved_weights(context.layout.breakable), capabilities(law.material)
        assert known.volume is not None
        exact = (
            closed_form_of_stress(law.material.functions)
            if known.membrane is None
            else closed_form(known.membrane)
        )  # fmt: skip
        layers = None
        if law.evaluation == "fused":
            assert law.loaded is not None
            layers = law.loaded.sigmoids()
        self.kernels = neural(
            context.layout, law.material.functions, known.volume, exact, weights == "corrected", layers
        )
        torch = law.evaluation == "torch"
        bonds = BondLaw(family_force=self.kernels.evaluated_force if torch else self.kernels.force)
        super().__init__(law, law.influence, context, weights, bonds)
        self.law = law
        # No potential of the force: what a damage field takes for the energy of a family.
        own = nodal(context.layout, law.material.functions)
        self.earlier_energy, self.represented = own.energy, own.represented
        if law.evaluation != "closed_form":
            # A network gives forces divided by mu.
            self.stress_unit = networks.unit_of_stress(law.material)
        self.outside: Array | None = None
        if law.loaded is not None:
            self.outside = context.array("outside_range", self.owner, wp.int32, shape=self.points)
        self._network: Call | None = None
        self._fingerprint: Callable[[], str] | None = None
        if torch:
            slots, types = self.families.members * self.points, context.types
            self._features = context.array(
                "features", self.owner, types.parameters, shape=slots, per="bond", intermediate=True
            )
            self.bond_constants = self.kernels.Evaluated()
            self.bond_constants.points = self.points
            self.bond_constants.pairs = context.array(
                "bond_pairs", self.owner, types.vec2, shape=slots, per="bond", intermediate=True
            )
            self.bond_constants.frame = context.array("frame", self.owner, types.mat32, shape=self.points)
            self._network, self._fingerprint = _torch_call(law, self.owner, self._features, self.bond_constants.pairs)

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        if self._network is not None:
            self.add_launch(
                stage, self.kernels.features, displacement, points=self.points, features=self._features,
                frame=self.bond_constants.frame,
            )  # fmt: skip
            stage.call(self._network)
        super().add_force(stage, displacement, out)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; at frames including the count of bonds outside the training range."""
        super().add(phase, stage)
        if phase is Phase.FRAME and self.outside is not None:
            assert self.law.loaded is not None
            least, most = self.law.loaded.stretches
            displacement = self.context.state.displacement
            self.add_launch(stage, self.kernels.outside, displacement, least=least, most=most, out=self.outside)

    def fingerprint(self) -> str:
        """A hash of the output of the network for some bonds."""
        return super().fingerprint() + ("" if self._fingerprint is None else self._fingerprint())

    def columns(self) -> Columns:
        """Columns of every law, and the number of bonds outside the training range, if that range is known."""
        columns = super().columns()
        return (
            columns if self.outside is None else replace(columns, names=("bonds_outside_training",), at_frame=self._row)
        )

    def _row(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Number of bonds outside the training range."""
        assert self.outside is not None
        return {"bonds_outside_training": float(np.sum(self.outside.numpy()))}

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes of every law, and one if bonds left the training range."""
        said = super().notes(history, load_duration)
        left = [row.get("bonds_outside_training", 0.0) for row in history]
        if self.law.loaded is None or not left or max(left) == 0.0:
            return said
        when = format_time(history[left.index(max(left))]["time"], load_duration)
        least, most = self.law.loaded.stretches
        return [
            *said,
            f"training range: up to {max(left):.0f} of {self.families.bond_count} bonds (at {when}) were outside the "
            f"principal stretches {least:g} to {most:g} of the training data",
        ]


def _torch_call(law: Neural, owner: str, features: Array, results: Array) -> tuple[Call, Callable[[], str]]:
    """The network as a Torch call in the step, and a function that returns its fingerprint.

    Raises:
        InputError: if Torch is not installed or the network has the wrong signature.
    """
    try:
        from .torch_step import TorchStep, capture
    except ImportError:
        raise InputError(NO_TORCH) from None
    step = TorchStep(law.loaded, law.network, features, results)
    touched = Touched(gathers=frozenset([features.ptr]), writes=frozenset([results.ptr]))
    return Call("network", owner, len(features), step, capture, touched), step.fingerprint


@tangent_of.register
def _(law: NeuralForce, context: Context, geometric: bool) -> Tangent:
    """Refuses `geometric` = False, and bonds that can break."""
    from ...laws.bond_associated import BondAssociated
    from .tangent import NeuralTangent

    if not geometric:
        raise InputError("stiffness = 'constant': expected 'tangent'; only the law BondBased has 'constant'")
    given = law.law
    like = BondAssociated(given.material, horizon=given.horizon, influence=given.influence, weights="plain")
    return NeuralTangent(law, like, context)
