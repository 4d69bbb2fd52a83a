"""Derivatives of measures at static equilibrium, by the tangent of Newton's method.

With R(u, p) the unbalanced force and K = -dR/du, equilibrium R = 0 gives K du/dp = dR/dp. A measure m(u, p) then has

    dm/dp = dm/dp at fixed u + dm/du . du/dp           direct: a solve for every constant, any measure
          = dm/dp at fixed u + l . dR/dp, K^T l = dm/du     adjoint: a solve for every measure

dR/dp is the central difference of the unbalanced force between two scenes whose argument differs by 6e-6 of its size,
at one displacement; held points go where each of the two wants them. It is exact to 1e-10 or so in float64. So any
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
    """Step of central differences: the cube root of round-off, times the size of the argument."""
    return float(np.finfo(np.float64 if bits == 64 else np.float32).eps ** (1 / 3)) * max(abs(value), abs(size))


def value_of(scene: Simulation, name: str) -> Value:
    """The function of a measure of a scene, or of a column that a part adds to the history.

    Raises:
        InputError: if there is no such measure.
    """
    for measure in scene.measures:
        if measure.name == name:
            return measure.value

    def column(built: Any, frame: Frame) -> float:
        for part in built.parts:
            if name in part.column_names():
                return float(part.columns({}, 0.0)[name])
        known = ", ".join(m.name for m in scene.measures) or "none"
        raise InputError(f"measure = {name!r}: expected a measure of the scene: {known}")

    return column


class Pair:
    """Two scenes whose argument differs by a step up and down, to be evaluated at any state of the one between.

    Attributes:
        step: Half of the difference.
    """

    def __init__(
        self, build: Build, settings: Mapping[str, Any], name: str, size: float, device: str | None, bits: int
    ) -> None:
        value = float(settings[name])
        self.name, self.step = name, step_of(value, size, bits)
        self.sides = [
            Equilibrium(for_differences(build(**{**settings, name: value + sign * self.step})), device, bits)
            for sign in (1.0, -1.0)
        ]
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
        """Derivative of a measure, with free components that move by `along` per unit of the argument."""
        total: Any = 0.0
        for weight, side, sign in zip(self._weights, self.sides, (1.0, -1.0), strict=True):
            moved = displacement if along is None else displacement + sign * self.step * along
            side.set(moved, factor)
            total = total + weight * np.asarray(value(side.built, side.frame()), dtype=np.float64)
        return np.asarray(total)


class Derivatives:
    """Derivatives of one scene by some of its arguments, at any of its states.

    Attributes:
        state: The scene.
        pairs: One for each argument.
    """

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
        """du/dp of the present state [m per unit], shape (P, N, 3): a solve for every argument."""
        state = self.state
        state.linearise()
        here, factor = state.displacement, state.factor
        return np.array([state.solve(pair.force(here, factor)) + pair.held(factor) for pair in self.pairs])

    def direct(self, values: Sequence[Value], along: np.ndarray | None = None) -> list[np.ndarray]:
        """Derivatives of measures, one array (..., P) each, with du/dp if it is known already."""
        here, factor = self.state.displacement, self.state.factor
        along = self.displacements() if along is None else along
        return [
            np.stack([p.change(v, here, factor, a) for p, a in zip(self.pairs, along, strict=True)], axis=-1)
            for v in values
        ]

    def adjoint(self, probes: Sequence[Probe]) -> np.ndarray:
        """Derivatives of probes, shape (M, P): a solve for every probe."""
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
        measures: Names, M of them.
        vary: Names of the arguments, P of them.
        values: shape (M,).
        jacobian: Derivatives, shape (M, P), each in the unit of its measure over that of its argument.
        method: "adjoint" or "direct".
        seconds: Time of the derivatives, without that of the equilibrium and of building the scenes.
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
        build: Function that makes the scene; its solver is Newton.
        vary: Names of arguments of `build`, numbers.
        measures: Names of measures of the scene, or of columns of its history.
        settings: Arguments of `build`; those that vary default to the function's own.
        factor: Load factor, 0 to 1.
        method: "adjoint" (a solve for every measure, which must be a Deflection or SupportForce), "direct" (a solve for
            every argument), or "auto": the adjoint where it is possible and takes fewer solves.
        device: As for `Simulation.run`.
        precision: As for `Simulation.run`.

    Raises:
        InputError: for names that do not exist, another solver, or an adjoint of a measure that has none.
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
    """Settings with the start values of the arguments that vary, from the defaults of `build`.

    Raises:
        InputError: for an argument that does not exist, is no number, or varies twice.
    """
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
