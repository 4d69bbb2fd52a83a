"""Bond-associated visco-hyperelasticity: Prony terms, and Maxwell elements, on the stress of each intersection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, not_negative, positive, show
from ..device.fields import Array, assign, to_host
from ..device.launches import Stage
from ..implicit.internal_variables import InternalVariables, internal_variables_of
from ..interfaces import BuiltLaw, Columns
from ..interfaces.scales import BRANCHES, Scales
from ..kernels.numeric import FunctionFactory
from ..kernels.visco.in_step import maxwell_moduli, prony_moduli, relaxed
from ..kernels.visco.maxwell import ElasticNetwork, branched_constants, branched_energy, maxwell_response
from ..kernels.visco.visco import prony_response, visco_energy
from ..laws.bond_associated import BondAssociated, BondAssociatedForce
from ..laws.family_law import FamilyLaw
from ..laws.force_paths import Reference, ResponseInStep, RowSums
from ..materials import capabilities
from ..step import Phase


@dataclass(frozen=True)
class Visco(BondAssociated):
    """Bond-associated visco-hyperelasticity in plane stress; the undeformed sheet is stress-free.

    With `branches` the material has Maxwell elements (kernels/visco/maxwell.py). They take every material, also a
    TensionField, whose wrinkles relax elastic and viscous stresses together, and every rupture criterion. The elastic
    energy alone drives a TearingEnergy (Shrimali and Lopez-Pamies, Extreme Mech. Lett. 58, 2023). The state has 4
    numbers per bond and branch.

    With `prony`, terms as in VE, the second Piola stress of every intersection is the material's (the long-term stress)
    plus stresses that relax: S = S_inf(C) + sum_p integral exp(-(t - t') / theta_p) dS_p(C(t')). The instantaneous
    stress is S_inf + sum_p S_p. See kernels/visco/visco.py, also for the stored and dissipated energy. The state has 4
    numbers per bond, and 4 more per Prony term.

    No motion can extract energy from either. When a bond breaks, the energy stored in its Prony terms counts as viscous
    loss. The strain of the remaining bonds jumps, which the energy balance then does not include; with branches it
    does.

    Attributes:
        material: Material of the long-term stress, such as Yeoh. Other arguments are those of BondAssociated.
        prony: Relaxing terms (keyword only).
        branches: Maxwell elements (keyword only); without these and `prony` the law is elastic.
        fast: Whether to use fast kernels on a CPU, which combine force and relaxation of a step (keyword only); a GPU
            has none.
    """

    prony: Sequence[Prony] = field(default=(), kw_only=True)
    branches: Sequence[Maxwell] = field(default=(), kw_only=True)
    fast: bool = field(default=True, kw_only=True)

    has_tangent: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        store_terms(self, "prony", Prony)
        known = capabilities(self.material)
        if self.prony and known.goes_slack:
            raise InputError(
                f"prony = {self.prony!r}: expected () with a TensionField material, which takes `branches` instead"
            )
        store_terms(self, "branches", Maxwell)
        if self.branches and self.prony:
            raise InputError(f"prony = {self.prony!r}: expected () with branches")
        if self.branches and known.goes_slack and (known.resisting is None or known.response is None):
            raise InputError(f"material = {show(self.material)}: expected a TensionField of a material with `response`")
        if self.branches and known.slack_stiffness > 0.0:
            raise InputError(f"slack_stiffness = {known.slack_stiffness:.6g}: expected 0 with branches")
        if self.weights == "published":
            raise InputError("weights = 'published': expected 'auto', 'plain' or 'corrected' with Visco")

    def build(self, context: Context) -> BuiltLaw:
        """Build the law. Raises InputError if the sheet or the weights do not allow the horizon."""
        if self.branches:
            return BranchedForce(self, context)
        return ViscoForce(self, context) if self.prony else ElasticVisco(self, context)


class ElasticVisco(BondAssociatedForce):
    """Visco without Prony terms, with only those force paths that store the force of every pair in `pairs`."""

    def paths(self) -> Sequence[type[Reference]]:
        """The force paths that fill `pairs`."""
        return RowSums, Reference

    def bond_force(self) -> Array:
        """Force of each family on its pairs [N], (members, N) vec3."""
        return self.pairs


class ViscousForce(ElasticVisco):
    """A viscous law on one sheet and device (base class).

    Attributes:
        path: Path of the kernel that fills `pairs` and advances the state.
        terms: Constants of its terms or branches.
        state: Internal variables, (rows * members, N).
        viscous_work: What `response` sums [J], (N,) float64.
        viscous: Energy that each family has dissipated [J], (N,) float64.
        in_step: Internal variables in implicit steps, or None.
    """

    depends_on_time = True
    takes_regions = False
    path: Reference
    terms: Array
    state: Array
    viscous: Array
    in_step: MaxwellInStep | PronyInStep | None = None

    def __init__(self, law: Visco, context: Context, terms: Array, response: FunctionFactory, rows: int) -> None:
        super().__init__(law, context)
        self.terms, self.response = terms, response
        self._given: Sequence[Prony | Maxwell] = (*law.prony, *law.branches)
        self.path = RowSums(self, response) if law.fast and RowSums.applies(self) else Reference(self, response)
        self._advanced: Stage | None = None
        shape, vec4 = (rows * self.families.members, self.points), context.types.parameters
        self.state = context.array("viscous_state", self.owner, vec4, shape=shape, per="bond", restart=True)
        self.viscous_work = context.array("viscous_work", self.owner, wp.float64, shape=self.points, restart=True)
        self._no_time = context.array("no_time", self.owner, context.types.real, np.zeros(1), per="table")

    def doubts(self, scales: Scales) -> Sequence[str]:
        """Those of its terms or branches."""
        return [doubt for term in self._given for doubt in term.doubts(scales)]

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; the state advances with the force."""
        super().add(phase, stage)
        if phase is Phase.INTERNAL_VARIABLES:
            assert self.context.state.step is not None
            self.add_pairs(stage, self.context.state.displacement, self.context.state.step, self.terms)
            self._advanced = stage

    def add_pairs(
        self, stage: Stage, displacement: Array, step: Array, terms: Array, state: Array | None = None
    ) -> None:
        """Add the launch that advances the state by a step [s] and fills `pairs` with the forces at its end."""
        given: dict[str, Any] = {
            "step": step, "terms": terms, "damage": self.damage, "state": self.state if state is None else state,
            "viscous_work": self.viscous_work,
        }  # fmt: skip
        self.path.add_pairs(stage, displacement, given)

    def add_others(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        if self.in_step is not None:
            self.add_pairs(stage, displacement, self._no_time, self.in_step.trial_terms, self.in_step.trial_state)
        elif self._advanced is not stage:
            self.add_pairs(stage, displacement, self._no_time, self.terms)
        self.add_gather(stage, self.pairs, out)

    def columns(self) -> Columns:
        """Columns of every law, and the viscous losses [J]."""
        return replace(super().columns(), lost={"viscous": self.viscous})

    def take(self, in_step: MaxwellInStep | PronyInStep, response: FunctionFactory) -> InternalVariables:
        """Let the force and the tangent of implicit steps take these internal variables."""
        self.in_step, self.steps_implicitly = in_step, True
        self.response_in_step = ResponseInStep(response, in_step.trial_terms, in_step.trial_state)
        return in_step


class ViscoForce(ViscousForce):
    """The law with Prony terms on one sheet and device."""

    takes_tension_field = False

    def __init__(self, law: Visco, context: Context) -> None:
        response = prony_response(law.material.functions)
        super().__init__(law, context, prony_array(law.prony, context), response, len(law.prony) + 1)
        self.prony = law.prony
        self.viscous = context.array("viscous", self.owner, wp.float64, shape=self.points)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of a phase; at the start those that apply the initial displacement instantaneously."""
        super().add(phase, stage)
        if phase is Phase.START and self.context.initial_displacement.any():
            displacement = self.context.state.displacement
            self.add_pairs(stage, displacement, *at_once(self.prony, self.context))
            # Fills `viscous`: the stored energy before it lies there as well.
            self.add_energy(stage, displacement, self.viscous)

    def begin(self) -> None:
        """Reset the losses: the work of the initial displacement is stored, not dissipated."""
        work = self.viscous_work
        work.assign(to_host(work) - to_host(self.viscous))

    def soften(self, damage: Array, near: Array) -> None:
        """Raise InputError: Prony terms do not support a damage field."""
        raise InputError("damage = TearingEnergy: expected Visco with branches, not prony, or another criterion")

    def add_energy(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that fills `out`, (N,) float64, with the stored energy of each family [J]."""
        self.add_launch(
            stage, visco_energy(self.layout, self.law.material.functions), displacement, unit_volume=self.unit_volume,
            prony=self.terms, state=self.state, viscous_work=self.viscous_work, out=out, dissipated=self.viscous,
        )  # fmt: skip


class BranchedForce(ViscousForce):
    """The law with Maxwell elements on one sheet and device.

    Attributes:
        network: The material without branches.
    """

    def __init__(self, law: Visco, context: Context) -> None:
        known = capabilities(law.material)
        elastic = known.resisting or law.material
        self.network = ElasticNetwork(elastic.functions, capabilities(elastic).response, known.wrinkle_width)
        self.branches, terms = law.branches, prony_array(law.branches, context, "branches")
        super().__init__(law, context, terms, maxwell_response(self.network), len(law.branches))
        self.viscous = self.viscous_work
        self.earlier_energy = branched_energy(self.layout, self.network, False)
        self.driving_energy = branched_energy(self.layout, self.network, True)
        self.partial_energy = None

    @property
    def energy_constants(self) -> Any:
        """Constants of the material, and constants and state of the branches."""
        given = branched_constants(self.network, self.context.bits)()
        given.elastic, given.branches, given.state = self.constants, self.terms, self.state
        return given

    def add_energy(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that fills `out`, (N,) float64, with the stored energy of each family [J]."""
        FamilyLaw.add_energy(self, stage, displacement, out)

    def field_names(self) -> tuple[str, ...]:
        """Names of all fields; not the wrinkle state, which the strain of a point does not determine."""
        return tuple(name for name in super().field_names() if name != "wrinkle_state")


@internal_variables_of.register
def _(law: ElasticVisco) -> None:
    """None, without terms."""
    law.steps_implicitly = True


@internal_variables_of.register
def _(law: ViscoForce) -> InternalVariables:
    """Prony terms in implicit steps. Raises InputError for relaxation times that depend on the rate."""
    material = law.law.material
    response = capabilities(material).response
    if response is None:
        raise _no_response(material)
    for term in law.prony:
        if term.constants[3] != 0.0:
            raise InputError(
                f"force = Visco: Prony.exponent = {term.exponent:g}: expected 0, or a fixed rate, with the solver "
                "Implicit; or the solver Explicit"
            )
    return law.take(PronyInStep(law), prony_moduli(material.functions, response))


@internal_variables_of.register
def _(law: BranchedForce) -> InternalVariables:
    """Maxwell elements in implicit steps. Raises InputError for a material without `response`."""
    if law.network.response is None:
        material = law.law.material
        raise _no_response(material)
    return law.take(MaxwellInStep(law, law.branches), maxwell_moduli(law.network))


def _no_response(material: Any) -> InputError:
    return InputError(f"force = Visco: material = {show(material)}: expected `response` for the solver Implicit")


# Relaxation time [s] for the step to the initial displacement: so long that nothing relaxes.
AT_ONCE = 1e30


def store_terms(law: Any, name: str, kind: type[Prony | Maxwell]) -> None:
    """Store the sequence of Prony terms or Maxwell elements in the attribute `name` of a frozen law as a tuple.

    Raises:
        InputError: if the attribute is anything else.
    """
    terms = getattr(law, name)
    if not isinstance(terms, Sequence) or not all(isinstance(term, kind) for term in terms):
        raise InputError(f"{name} = {terms!r}: expected a sequence of {kind.__name__}")
    object.__setattr__(law, name, tuple(terms))


def prony_array(prony: Sequence[Prony | Maxwell], context: Context, name: str = "prony") -> Array:
    """Copy the constants of the terms to the device."""
    values = np.array([term.constants for term in prony])
    return context.array(name, "Visco", context.types.parameters, values, per="table")


def at_once(prony: Sequence[Prony], context: Context) -> tuple[Array, Array]:
    """A time step of 1 s, and the Prony terms with relaxation times so long that nothing relaxes in that step."""
    slow = tuple(replace(term, time=AT_ONCE, exponent=0.0) for term in prony)
    one_second = context.array("one_second", "Visco", context.types.real, np.ones(1), per="table")
    return one_second, prony_array(slow, context, "prony_at_once")


@dataclass(frozen=True)
class Prony:
    """A term of a Prony series: a Yeoh stress that relaxes. Sources: VE eqs. 17 and 19.

    The relaxation time is theta = time * |dC/dt|^-exponent, with the rate |dC/dt| of the three-dimensional strain [1/s]
    (VE eqs. 31 to 33). In the paper each test has one fixed rate: give it as `rate`. Without it the local, current rate
    is used; then nothing relaxes at rest unless the exponent is 0.

    Attributes:
        c10: First Yeoh constant [Pa].
        c20: Second Yeoh constant [Pa], at least 0: the energy must be convex so that dissipation is not negative.
        time: Relaxation time at the rate 1/s [s]; phi_ref in the paper.
        exponent: eta in the paper [-]; 0 for a constant relaxation time.
        rate: A fixed rate [1/s], or None.

    Raises:
        InputError: if a constant is outside these bounds.
    """

    c10: float
    c20: float = 0.0
    time: float = 1.0
    exponent: float = 0.0
    rate: float | None = None

    def __post_init__(self) -> None:
        positive("Prony.c10", self.c10)
        not_negative("Prony.c20", self.c20)
        positive("Prony.time", self.time)
        not_negative("Prony.exponent", self.exponent)
        if self.rate is not None:
            positive("Prony.rate", self.rate)

    def doubts(self, scales: Scales) -> list[str]:
        """Whether it is far from the material's modulus."""
        return _of_branch(f"Prony(c10={self.c10:g}, time={self.time:g})", 2.0 * self.c10, scales)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """(c10, c20, relaxation time at the fixed rate or at 1/s, exponent, 0 for a fixed rate)."""
        if self.rate is None:
            return (self.c10, self.c20, self.time, self.exponent)
        return (self.c10, self.c20, self.time * self.rate**-self.exponent, 0.0)


@dataclass(frozen=True)
class Maxwell:
    """A viscous branch: a neo-Hookean network whose chains let go and form again free of stress.

    At a constant stretch its stress decays as exp(-t / time), at small strains it is the spring and dashpot in series
    of a Prony series. No motion extracts energy from it. See kernels/visco/maxwell.py; sources: Green and Tobolsky
    1946, Lubliner 1985.

    Attributes:
        modulus: Shear modulus of the branch [Pa], in addition to that of the material.
        time: Relaxation time [s].

    Raises:
        InputError: if a constant is not positive.
    """

    modulus: float
    time: float

    def __post_init__(self) -> None:
        positive("Maxwell.modulus", self.modulus)
        positive("Maxwell.time", self.time)

    def doubts(self, scales: Scales) -> list[str]:
        """Whether it is far from the material's modulus."""
        return _of_branch(f"Maxwell(modulus={self.modulus:g}, time={self.time:g})", self.modulus, scales)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """(modulus, time, 0, 0)."""
        return (self.modulus, self.time, 0.0, 0.0)


def _of_branch(what: str, modulus: float, scales: Scales) -> list[str]:
    meant = "are modulus and time swapped? Moduli are in Pa, times in s"
    return scales.of_stress(f"{what}: its modulus", modulus, meant, BRANCHES)


class MaxwellInStep(InternalVariables):
    """M of Maxwell elements, by the exact update for a C^-1 that is linear in time in each step.

    With x = dt / tau that is M <- (1 - k) M + (k - b) C^-1(n) + b C^-1(n+1), k = 1 - exp(-x), b = 1 - k / x. It is
    taken as two steps at constant C, one at each end, that are x - ln(x / k) and ln(x / k) long, so that what is lost
    is known exactly. What forms during the step is free of stress at its end: b weakens the branch, no more. The second
    and the first of the next step, at the same C, are one.
    """

    def __init__(self, force: BranchedForce, branches: Sequence[Maxwell]) -> None:
        """Allocate the terms of a step, and let the force and its tangent take them."""
        self._force, context = force, force.context
        self._exact = np.array([term.constants for term in branches])
        one = context.array("unit_step", force.owner, context.types.real, np.ones(1), per="table")
        self._relaxing, self.trial_terms = (
            context.array(f"branches_{name}", force.owner, context.types.parameters, self._exact, per="table")
            for name in ("relaxing", "in_step")
        )
        self.trial_state = force.state
        force.add_pairs(context.stage("relax", "every implicit step"), context.state.displacement, one, self._relaxing)
        self._dt = 0.0
        # Time over relaxation time at the end of a step, by branch; what is still to relax, and was before the step.
        self._after = self._left = self._was_left = np.zeros(len(branches))
        self._set = self._left

    def begin_step(self, dt: float, again: bool) -> None:
        """Relax at the displacement before a step of dt [s], also what the last step has left."""
        if dt != self._dt:
            self._dt, values = dt, self._exact.copy()
            x = dt / self._exact[:, 1]
            weaker = -np.expm1(-x) / x
            values[:, 0] *= weaker
            assign(self.trial_terms, values)
            self._after = -np.log(weaker)
        if again:
            self._left = self._was_left
        self._was_left = self._left
        self._relax(self._left + dt / self._exact[:, 1] - self._after)

    def end_step(self) -> None:
        """Leave the rest to the next step, which begins at the same displacement."""
        self._left = self._after

    def settle(self) -> None:
        """Relax what the last step has left."""
        if self._left.any():
            self._relax(self._left)

    def _relax(self, x: np.ndarray) -> None:
        """Relax at the present displacement for x times the relaxation time of each branch."""
        if not np.array_equal(x, self._set):
            values = self._exact.copy()
            values[:, 1] = 1.0 / x
            assign(self._relaxing, values)
            self._set = x
        self._force.context.sequence("relax").run()
        self._left = np.zeros_like(x)


class PronyInStep(InternalVariables):
    """Stresses of Prony terms, by the exact update for a stress S_p(C) that is linear in time in each step."""

    def __init__(self, force: ViscoForce) -> None:
        """Allocate the terms and the state of a step, and let the force and its tangent take them."""
        self._force, context = force, force.context
        self._exact = np.array([term.constants for term in force.prony])
        self._step = context.array("law_step", force.owner, context.types.real, np.ones(1), per="once")
        self.trial_terms = context.array(
            "prony_in_step", force.owner, context.types.parameters, self._exact, per="table"
        )
        self.trial_state = context.array(
            "viscous_state_in_step", force.owner, context.types.parameters, shape=force.state.shape, per="bond"
        )
        stage = context.stage("relax before", "every implicit step")
        stage.launch(
            force.owner, relaxed(context.bits), force.points, step=self._step, prony=force.terms, state=force.state,
            members=force.families.members, relaxed=self.trial_state,
        )  # fmt: skip
        stage = context.stage("relax after", "every implicit step")
        force.add_pairs(stage, context.state.displacement, self._step, force.terms)
        self._dt = 0.0

    def begin_step(self, dt: float, again: bool) -> None:
        """Find what is left of the stresses after a step of dt [s], and what remains of those that it adds."""
        if dt != self._dt:
            self._dt = dt
            assign(self._step, np.array([dt]))
            x = dt / self._exact[:, 2]
            values = self._exact.copy()
            values[:, :2] *= (-np.expm1(-x) / x)[:, None]
            assign(self.trial_terms, values)
        self._force.context.sequence("relax before").run()

    def end_step(self) -> None:
        """Advance to the displacement after the step."""
        self._force.context.sequence("relax after").run()

    def settle(self) -> None:
        """Nothing is left."""
