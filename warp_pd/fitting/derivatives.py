"""Derivatives of measures at static equilibrium, using the tangent of Newton's method.

With R(u, p) the unbalanced force and K = -dR/du, equilibrium R = 0 gives K du/dp = dR/dp. A measure m(u, p) then has

    dm/dp = dm/dp at fixed u + dm/du . du/dp           direct: one solve per constant, any measure
          = dm/dp at fixed u + l . dR/dp, K^T l = dm/du     adjoint: one solve per measure

dR/dp is the central difference of the unbalanced force between two scenes whose argument differs by 6e-6 of its size,
at the same displacement except for held points, which each scene prescribes. It is exact to about 1e-10 in float64. Any
argument of a scene may be varied: constants, thickness, pressure, prestretch.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from ..device.checks import InputError, one_of
from ..interfaces.frame import Frame
from ..run.simulation import Simulation
from .equilibrium import Equilibrium, for_differences
from .probes import Probe

Build = Callable[..., Simulation]
# What is measured: a name of a measure or column, and its function.
Value = Callable[[Any, Frame], Any]
METHODS = ("auto", "adjoint", "direct")


def step_of(value: float, size: float, bits: int) -> float:
    """Step of central differences: the cube root of round-off times the size of the argument."""
    eps = np.finfo(np.float64 if bits == 64 else np.float32).eps
    return float(eps ** (1 / 3)) * (max(abs(value), abs(size)) or 1.0)


def value_of(scene: Simulation, name: str) -> Value:
    """The function of a measure of a scene, or of a history column of a part."""
    for measure in scene.measures:
        if measure.name == name:
            return measure.value

    def column(built: Any, frame: Frame) -> float:
        for columns in built.columns:
            if name in columns.names:
                return float(columns.at_frame({}, 0.0)[name])
        known = ", ".join(m.name for m in scene.measures) or "none"
        raise InputError(f"measure = {name!r}: expected a measure of the scene: {known}")

    return column


class Pair:
    """Two scenes with an argument increased and decreased by a step, evaluated at states of the original scene.

    Attributes:
        step: Half of the difference of the argument.
    """

    def __init__(
        self, build: Build, settings: Mapping[str, Any], name: str, size: float, device: str | None, bits: int
    ) -> None:
        value = float(settings[name])
        self.name, self.step = name, step_of(value, size, bits)

        def at(sign: float) -> Equilibrium:
            return Equilibrium(for_differences(build(**{**settings, name: value + sign * self.step})), device, bits)

        ahead = at(1.0)
        try:
            behind = at(-1.0)
        except InputError:
            # Zero is the least value: a difference to one side.
            self.step *= 0.5
            ahead, behind = at(2.0), at(0.0)
        self.sides = [ahead, behind]
        self._weights = (0.5 / self.step, -0.5 / self.step)

    def force(self, displacement: np.ndarray, factor: float) -> np.ndarray:
        """dR/dp at fixed displacement of the free components [N per unit], shape (N, 3)."""
        return self.force_and_changes(displacement, factor, ())[0]

    def force_and_changes(
        self, displacement: np.ndarray, factor: float, probes: Sequence[Probe]
    ) -> tuple[np.ndarray, np.ndarray]:
        """As `force`, and the derivatives of probes at fixed displacement, shape (M,)."""
        total, changes = np.zeros_like(displacement), np.zeros(len(probes))
        for weight, side in zip(self._weights, self.sides, strict=True):
            side.set(displacement, factor)
            total += weight * side.residual()
            if probes:
                frame = side.bare_frame()
                changes += [weight * probe(side.built, frame) for probe in probes]
        return total, changes

    def held(self, factor: float) -> np.ndarray:
        """du/dp of the held components [m per unit], shape (N, 3)."""
        return np.asarray(sum(w * side.held_at(factor) for w, side in zip(self._weights, self.sides, strict=True)))

    def change(self, value: Value, displacement: np.ndarray, factor: float, along: np.ndarray | None) -> np.ndarray:
        """Derivative of a measure if free components move by `along` per unit of the argument."""
        total: Any = 0.0
        for weight, side, sign in zip(self._weights, self.sides, (1.0, -1.0), strict=True):
            moved = displacement if along is None else displacement + sign * self.step * along
            side.set(moved, factor)
            total = total + weight * np.asarray(value(side.built, side.frame()), dtype=np.float64)
        return np.asarray(total)


class Derivatives:
    """Derivatives of a scene by some of its arguments, at any of its states."""

    def __init__(
        self, build: Build, settings: Mapping[str, Any], vary: Sequence[str], sizes: Sequence[float] | None = None,
        device: str | None = None, precision: int | None = None,
    ) -> None:  # fmt: skip
        self.scene = build(**settings)
        self.state = Equilibrium(self.scene, device, precision)
        sizes = [0.0] * len(vary) if sizes is None else sizes
        bits = self.state.built.context.bits
        self.pairs = [Pair(build, settings, name, size, device, bits) for name, size in zip(vary, sizes, strict=True)]

    def displacements(self) -> np.ndarray:
        """du/dp at the current state [m per unit], shape (P, N, 3), with one solve per argument."""
        state = self.state
        state.linearise()
        here, factor = state.displacement, state.factor
        return np.array([state.solve(pair.force(here, factor)) + pair.held(factor) for pair in self.pairs])

    def direct(self, values: Sequence[Value], along: np.ndarray | None = None) -> list[np.ndarray]:
        """Derivatives of measures, one array (..., P) each; `along` is du/dp if already known."""
        here, factor = self.state.displacement, self.state.factor
        along = self.displacements() if along is None else along
        return [
            np.stack([p.change(v, here, factor, a) for p, a in zip(self.pairs, along, strict=True)], axis=-1)
            for v in values
        ]

    def adjoint(self, probes: Sequence[Probe]) -> np.ndarray:
        """Derivatives of probes, shape (M, P), with one solve per probe."""
        state = self.state
        state.linearise()
        here, factor = state.displacement, state.factor
        made = [pair.force_and_changes(here, factor, probes) for pair in self.pairs]
        forces, changes = np.array([force for force, _ in made]), np.array([change for _, change in made])
        multipliers = np.array([state.solve_transposed(probe.gradient(state)) for probe in probes])
        return np.asarray(np.einsum("mic,pic->mp", multipliers, forces) + changes.T)


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Values and derivatives of measures at equilibrium.

    Attributes:
        measures: Names of the M measures.
        vary: Names of the P arguments.
        values: Values of the measures, shape (M,).
        jacobian: Derivatives, shape (M, P), in the unit of the measure divided by that of the argument.
        method: "adjoint" or "direct".
        seconds: Wall time of the derivatives [s], without equilibrium and building of scenes.
    """

    measures: tuple[str, ...]
    vary: tuple[str, ...]
    values: np.ndarray
    jacobian: np.ndarray
    method: str
    seconds: float


def sensitivity(
    build: Build,
    vary: Sequence[str],
    measures: Sequence[str],
    settings: Mapping[str, Any] | None = None,
    *,
    factor: float = 1.0,
    method: str = "auto",
    device: str | None = None,
    precision: int | None = None,
) -> Sensitivity:
    """Derivatives of measures of a scene by its arguments, in static equilibrium.

    Args:
        build: Function that builds the scene, whose solver must be Newton.
        vary: Names of numerical arguments of `build`.
        measures: Names of measures of the scene, or of columns of its history.
        settings: Arguments of `build`; others have their defaults.
        factor: Load factor, 0 to 1.
        method: "adjoint" (one solve per measure, which must be a Deflection or SupportForce), "direct" (one solve per
            argument), or "auto" (the adjoint if possible and with fewer solves).
        device: As for `Simulation.run`.
        precision: As for `Simulation.run`.

    Raises:
        InputError: if a name does not exist, the solver is not Newton, or a measure has no adjoint.
    """
    one_of("method", method, METHODS)
    given = with_defaults(build, vary, settings or {})
    derivatives = Derivatives(build, given, vary, None, device, precision)
    state = derivatives.state
    state.reach(factor)
    values = [value_of(derivatives.scene, name) for name in measures]
    probes = [value for value in values if isinstance(value, Probe)]
    possible = len(probes) == len(values) and state.has_adjoint
    if method == "adjoint" and not possible:
        raise InputError("method = 'adjoint': expected measures that are a Deflection or SupportForce; take 'direct'")
    adjoint = possible and (method == "adjoint" or (method == "auto" and len(values) <= len(vary)))
    frame = state.frame()
    numbers = np.array([float(value(state.built, frame)) for value in values])
    begin = perf_counter()
    jacobian = derivatives.adjoint(probes) if adjoint else np.array(derivatives.direct(values))
    taken = perf_counter() - begin
    return Sensitivity(tuple(measures), tuple(vary), numbers, jacobian, "adjoint" if adjoint else "direct", taken)


def with_defaults(build: Build, vary: Sequence[str], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings with the values of the varied arguments, by default those of `build`."""
    parameters = inspect.signature(build).parameters
    out = dict(settings)
    for index, name in enumerate(vary):
        if name not in parameters and name not in out:
            raise InputError(f"vary = {name!r}: expected an argument of the scene: {', '.join(parameters)}")
        if name in vary[:index]:
            raise InputError(f"vary = {name!r}: expected each argument once")
        value = out.setdefault(name, parameters[name].default if name in parameters else None)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{name} = {value!r}: expected a number to vary; give its start value")
    return out
