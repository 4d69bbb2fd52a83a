"""Membrane finite elements in the plane or in space, total-Lagrangian, statics and explicit dynamics.

They share nothing with the package: tests and studies compare with them. scikit-fem gives meshes, shape functions and
quadrature. G_1 and G_2 are the derivatives of the position by x and y, C_ab = G_a . G_b, and the energy per volume is
W(t, d) with t = tr C and d = det C; the stretch across the sheet is eliminated (plane stress). So

    P_a = dW/dG_a = 2 (W_t G_a + W_d H_a),   H_a = adj(C)_ab G_b.

Newton's method takes the exact derivative, that of the follower pressure included, and SuperLU solves. Element matrices
are products over all elements at once: the forms of scikit-fem loop over pairs of shape functions and take thirty times
as long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu
from skfem import Basis, ElementQuad1, ElementQuad2, Mesh, MeshQuad, MeshQuad2

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
# (t, d) -> W_t, W_d, W_tt, W_td, W_dd.
Response = Callable[[Array, Array], tuple[Array, ...]]
# First and second derivative of an energy by its argument.
Slopes = Callable[[Array], tuple[Array, Array]]


# Materials -------------------------------------------------------------------------------------------------------


def incompressible(mu: float, stiffening: float = 0.0) -> Response:
    """W = mu / 2 (I + c I^2), I = t + 1/d - 3: neo-Hookean, or Yeoh's material with c = c20 / c10."""

    def response(t: Array, d: Array) -> tuple[Array, ...]:
        by_d = -1.0 / d**2
        slope = 0.5 * mu * (1.0 + 2.0 * stiffening * (t + 1.0 / d - 3.0))
        curve = np.full_like(slope, mu * stiffening)
        return slope, slope * by_d, curve, curve * by_d, curve * by_d**2 + 2.0 * slope / d**3

    return response


@dataclass(frozen=True)
class Compressible:
    """W = f(I) + g(q), I = q^-1/3 (t + c), q = c d, with c = C33 of zero stress across the sheet.

    Attributes:
        shear: I -> f', f''.
        volume: q -> g', g''.
    """

    shear: Slopes
    volume: Slopes

    def __call__(self, t: Array, d: Array) -> tuple[Array, ...]:
        """The response, with c by Newton's method."""
        c = 1.0 / d
        for _ in range(30):
            by_c, by_cc = self._across(t, d, c)
            change = -by_c / by_cc
            c = c * np.exp(np.clip(change / c, -0.5, 0.5))
            if np.abs(change / c).max(initial=0.0) < 1e-7:
                break
        p, q = (c * d) ** (-1.0 / 3.0), c * d
        first = p * (t + c)
        (f1, f2), (g1, g2) = self.shear(first), self.volume(q)
        _, by_cc = self._across(t, d, c)
        i_c, i_d = p - first / (3.0 * c), -first / (3.0 * d)
        by_tc = f2 * p * i_c - f1 * p / (3.0 * c)
        by_dc = f2 * i_d * i_c + f1 * (first / (3.0 * c) - p) / (3.0 * d) + g2 * d * c + g1
        by_td = f2 * p * i_d - f1 * p / (3.0 * d)
        by_dd = f2 * i_d**2 + f1 * 4.0 * first / (9.0 * d**2) + g2 * c**2
        return (
            f1 * p, f1 * i_d + g1 * c,
            f2 * p**2 - by_tc**2 / by_cc, by_td - by_tc * by_dc / by_cc, by_dd - by_dc**2 / by_cc,
        )  # fmt: skip

    def _across(self, t: Array, d: Array, c: Array) -> tuple[Array, Array]:
        """First and second derivative of the energy by c."""
        p = (c * d) ** (-1.0 / 3.0)
        first = p * (t + c)
        (f1, f2), (g1, g2) = self.shear(first), self.volume(c * d)
        i_c = p - first / (3.0 * c)
        return f1 * i_c + g1 * d, f2 * i_c**2 + f1 * (first / c - p - i_c) / (3.0 * c) + g2 * d**2

    def strip_width(self, large: Array) -> Array:
        """Squared stretch across a strip that is pulled to the squared stretch `large` along it."""
        width = large**-0.5
        for _ in range(30):
            q = large * width**2
            p = q ** (-1.0 / 3.0)
            (f1, f2), (g1, g2) = self.shear(p * (large + 2.0 * width)), self.volume(q)
            value = f1 * p * (width - large) / 3.0 + g1 * q
            slope = f1 * p * (1.0 + 2.0 * large / width) / 9.0 + 2.0 * (g1 + g2 * q) * q / width
            slope += 2.0 * f2 * (p * (width - large) / 3.0) ** 2 / width
            width = width - value / slope
            if np.abs(value / slope).max(initial=0.0) < 1e-7:
                break
        return width

    def relaxed(self, t: Array, d: Array) -> tuple[Array, ...]:
        """The response of tension field theory, for dynamics: second derivatives are NaN.

        A state that would be compressed across its larger principal stretch carries the stress of a strip in tension;
        one that is stretched in no direction carries none.
        """
        radius = np.sqrt(np.maximum(0.25 * t**2 - d, 0.0))
        large, small = np.maximum(0.5 * t + radius, 1.0), 0.5 * t - radius
        width = self.strip_width(large)
        taut = small >= width
        p = (large * width**2) ** (-1.0 / 3.0)
        pull = self.shear(p * (large + 2.0 * width))[0] * p * (1.0 - width / large) / np.maximum(2.0 * radius, 1e-9)
        by_t, by_d = pull * large, -pull
        by_t[taut], by_d[taut] = self(t[taut], d[taut])[:2]
        return by_t, by_d, *np.full((3, *t.shape), np.nan)


@dataclass(frozen=True)
class TensionField:
    """The incompressible neo-Hookean sheet in tension field theory, with its second derivatives, for statics.

    Attributes:
        mu: Shear modulus [Pa].
        share: Fraction of the energy that resists compression, so that no state is without stiffness: a limit towards
            0 is to be taken [-].
    """

    mu: float
    share: float

    def energy(self, t: Array, d: Array) -> Array:
        """Energy per volume [J/m^3]."""
        large, wrinkled, slack = self._state(t, d)[1:]
        taut = 0.5 * self.mu * (t + 1.0 / d - 3.0)
        relaxed = np.where(wrinkled, 0.5 * self.mu * (large + 2.0 * large**-0.5 - 3.0), taut)
        return self.share * taut + (1.0 - self.share) * np.where(slack, 0.0, relaxed)

    def __call__(self, t: Array, d: Array) -> tuple[Array, ...]:
        """The response: wrinkled, the energy is one of the larger eigenvalue of C alone."""
        radius, large, wrinkled, slack = self._state(t, d)
        radius = np.maximum(radius, 1e-6)
        slope = np.where(slack, 0.0, 0.5 * self.mu * (1.0 - large**-1.5))
        curve = np.where(slack, 0.0, 0.75 * self.mu * large**-2.5)
        by_t, by_d = 0.5 * large / radius, -0.5 / radius
        by_td, by_dd = 0.125 * t / radius**3, -0.25 / radius**3
        by_tt = 0.5 * by_t / radius - 0.125 * large * t / radius**3
        wrinkles = (
            slope * by_t, slope * by_d, curve * by_t**2 + slope * by_tt, curve * by_t * by_d + slope * by_td,
            curve * by_d**2 + slope * by_dd,
        )  # fmt: skip
        taut = incompressible(self.mu)(t, d)
        return tuple(
            self.share * a + (1.0 - self.share) * np.where(wrinkled, b, a) for a, b in zip(taut, wrinkles, strict=True)
        )

    @staticmethod
    def _state(t: Array, d: Array) -> tuple[Array, ...]:
        """Half the difference of the eigenvalues of C, the larger one, and which states are wrinkled and slack."""
        radius = np.sqrt(np.maximum(0.25 * t**2 - d, 0.0))
        large = 0.5 * t + radius
        wrinkled = 0.5 * t - radius < large**-0.5
        return radius, large, wrinkled, wrinkled & (large <= 1.0)


def neo_hookean(mu: float, bulk: float) -> Compressible:
    """The material of NN: W = mu/2 (I - 3) + K/8 (q + 1/q - 2)."""
    return Compressible(
        lambda first: (np.full_like(first, 0.5 * mu), np.zeros_like(first)),
        lambda q: (0.125 * bulk * (1.0 - q**-2), 0.25 * bulk * q**-3),
    )


def gent(mu: float, bulk: float, lock: float) -> Compressible:
    """The material of BA: W = -mu Jm / 2 log(1 - (I - 3)/Jm) + K/4 (q - 1 - log q)."""

    def shear(first: Array) -> tuple[Array, Array]:
        room = 1.0 - (first - 3.0) / lock
        return 0.5 * mu / room, 0.5 * mu / (lock * room**2)

    return Compressible(shear, lambda q: (0.25 * bulk * (1.0 - 1.0 / q), 0.25 * bulk / q**2))


# Elements --------------------------------------------------------------------------------------------------------


def rectangle(x: Array, y: Array, nine: bool) -> Mesh:
    """A tensor grid of vertices with quadrilaterals of four or nine nodes."""
    mesh = MeshQuad.init_tensor(x, y)
    return MeshQuad2.from_mesh(mesh) if nine else mesh


@dataclass(eq=False)
class Membrane:
    """A sheet of quadrilaterals.

    Attributes:
        mesh: Of scikit-fem; MeshQuad2 for elements of nine nodes.
        material: Its energy.
        thickness: [m].
        components: 2 in the plane, 3 in space.
        pressure: Follower pressure along the normal [Pa], in space only.
        intorder: Order of the quadrature; by default 2, and 4 with nine nodes.
        displacement: Of the nodes, (N, components) [m].
        iterations: Newton's, so far.
    """

    mesh: Mesh
    material: Response
    thickness: float
    components: int
    pressure: float = 0.0
    intorder: int | None = None
    displacement: Array = field(init=False)
    iterations: int = 0

    def __post_init__(self) -> None:
        self.displacement = np.zeros((self.nodes.shape[0], self.components))

    @cached_property
    def basis(self) -> Basis:
        """Scalar shape functions."""
        nine = isinstance(self.mesh, MeshQuad2)
        order = self.intorder or (4 if nine else 2)
        return Basis(self.mesh, ElementQuad2() if nine else ElementQuad1(), intorder=order)

    @cached_property
    def nodes(self) -> Array:
        """(N, 2) [m]."""
        return np.ascontiguousarray(self.basis.doflocs.T)

    @cached_property
    def elements(self) -> Indices:
        """Nodes of each element, (elements, nodes of one)."""
        return np.ascontiguousarray(self.basis.element_dofs.T).astype(np.int64)

    @cached_property
    def shapes(self) -> Array:
        """Shape functions at the points of integration, (elements, points, nodes of one)."""
        values = [np.broadcast_to(np.asarray(b[0]), self.weights.shape) for b in self.basis.basis]
        return np.ascontiguousarray(np.stack(values, axis=-1))

    @cached_property
    def gradients(self) -> Array:
        """(elements, points, nodes of one, 2) [1/m]."""
        stacked = np.stack([np.asarray(b[0].grad) for b in self.basis.basis])
        return np.ascontiguousarray(stacked.transpose(2, 3, 0, 1))

    @cached_property
    def weights(self) -> Array:
        """Areas of the points of integration, (elements, points) [m^2]."""
        return np.asarray(self.basis.dx)

    @cached_property
    def _operators(self) -> tuple[csr_matrix, csr_matrix]:
        """Matrices from values at nodes to gradients, (elements points 2, N), and values, (elements points, N)."""
        e, _, n, _ = self.gradients.shape
        size = self.nodes.shape[0]

        def sparse(entries: Array) -> csr_matrix:
            rows = entries.size // n
            where = np.repeat(self.elements, rows // e, axis=0).ravel()
            return csr_matrix((entries.ravel(), where, n * np.arange(rows + 1)), shape=(rows, size))

        return sparse(self.gradients.transpose(0, 1, 3, 2)), sparse(self.shapes)

    @cached_property
    def _pattern(self) -> tuple[Indices, Indices, Indices]:
        """Where each entry of the element matrices goes, and the columns of the sparse matrix."""
        dofs = (self.elements[:, :, None] * self.components + np.arange(self.components)).reshape(
            len(self.elements), -1
        )
        size = self.displacement.size
        keys = (dofs[:, None, :] * size + dofs[:, :, None]).ravel()
        unique, where = np.unique(keys, return_inverse=True)
        return where, unique % size, np.searchsorted(unique // size, np.arange(size + 1))

    def deformation(self) -> Array:
        """G_1 and G_2 at the points of integration, (elements, points, 2, components)."""
        moved = (self._operators[0] @ self.displacement).reshape(*self.weights.shape, 2, self.components)
        moved[..., :2] += np.eye(2)
        return moved

    def forces(self) -> Array:
        """Internal less external forces on the nodes, (N, components) [N]."""
        G, P, *_ = self._stressed()
        return self._loads(G, P)

    def _stressed(self) -> tuple[Array, Array, Array, tuple[Array, ...]]:
        """G and P, (elements, points, 2, components), C11, C22, C12 and the derivatives of the energy."""
        G = self.deformation()
        one, two = G[..., 0, :], G[..., 1, :]
        C = np.stack([np.einsum("eqc,eqc->eq", a, b) for a, b in ((one, one), (two, two), (one, two))])
        energy = self.material(C[0] + C[1], C[0] * C[1] - C[2] ** 2)
        w_t, w_d, *_ = energy
        P = np.empty_like(G)
        mixed = (2.0 * w_d * C[2])[..., None]
        P[..., 0, :] = (2.0 * (w_t + w_d * C[1]))[..., None] * one - mixed * two
        P[..., 1, :] = (2.0 * (w_t + w_d * C[0]))[..., None] * two - mixed * one
        return G, P, C, energy

    def _loads(self, G: Array, P: Array) -> Array:
        by_gradient, by_value = self._operators
        weighted = self.thickness * self.weights[..., None, None] * P
        total = by_gradient.T @ weighted.reshape(-1, self.components)
        if self.pressure:
            push = self.pressure * self.weights[..., None] * np.cross(G[..., 0, :], G[..., 1, :])
            total -= by_value.T @ push.reshape(-1, 3)
        return total

    def assembled(self) -> tuple[Array, csc_matrix]:
        """The forces, and their derivative by the displacement."""
        G, P, C, (w_t, w_d, w_tt, w_td, w_dd) = self._stressed()
        e, q, _, c = G.shape
        H = np.stack([C[1], C[0]], axis=-1)[..., None] * G - C[2][..., None, None] * G[..., ::-1, :]
        g, h = G.reshape(e, q, 2 * c), H.reshape(e, q, 2 * c)
        moduli = (4.0 * w_tt)[..., None, None] * g[..., :, None] * g[..., None, :]
        moduli += (4.0 * w_dd)[..., None, None] * h[..., :, None] * h[..., None, :]
        mixed = (4.0 * w_td)[..., None, None] * g[..., :, None] * h[..., None, :]
        moduli += mixed + mixed.swapaxes(-1, -2)
        moduli = moduli.reshape(e, q, 2, c, 2, c)
        unit = np.eye(c)
        for a, b in ((0, 1), (1, 0)):
            here, there = G[..., a, :], G[..., b, :]
            product = np.einsum("eqc,eqd->eqcd", here, there)
            # dH_a/dG_a and dH_a/dG_b.
            same = C[b][..., None, None] * unit - there[..., :, None] * there[..., None, :]
            other = 2.0 * product - product.swapaxes(-1, -2) - C[2][..., None, None] * unit
            moduli[:, :, a, :, a, :] += 2.0 * (w_t[..., None, None] * unit + w_d[..., None, None] * same)
            moduli[:, :, a, :, b, :] += 2.0 * w_d[..., None, None] * other
        moduli *= self.thickness * self.weights[..., None, None, None, None]
        n = self.elements.shape[1]
        left = self.gradients @ moduli.reshape(e, q, 2, c * 2 * c)
        left = left.reshape(e, q, n, c, 2, c).transpose(0, 2, 3, 5, 1, 4).reshape(e, n * c * c, q * 2)
        right = self.gradients.transpose(0, 1, 3, 2).reshape(e, q * 2, n)
        matrix = (left @ right).reshape(e, n, c, c, n).transpose(0, 1, 2, 4, 3)
        if self.pressure:
            matrix = matrix - self._pressure_stiffness(G)
        where, rows, columns = self._pattern
        values = np.bincount(where, weights=matrix.ravel(), minlength=len(rows))
        return self._loads(G, P), csc_matrix((values, rows, columns), shape=(self.displacement.size,) * 2)

    def _pressure_stiffness(self, G: Array) -> Array:
        """Derivative of the force p (G_1 x G_2) on an area, (elements, nodes of one, 3, nodes of one, 3)."""
        one, two = G[..., 0, :], G[..., 1, :]
        loaded = self.pressure * self.weights[..., None] * self.shapes
        by_component = []
        for unit in np.eye(3):
            turned = np.stack([np.cross(unit, two), np.cross(one, unit)], axis=-2)
            by_component.append(np.einsum("eqa,eqbc->eacb", loaded, self.gradients @ turned, optimize=True))
        return np.stack(by_component, axis=-1)

    def solve(self, held: Flags, goal: Array | None = None, tolerance: float = 1e-6, limit: int = 60) -> None:
        """Iterate to equilibrium.

        Args:
            held: Given components of the displacement, (N, components).
            goal: Displacement to which they go [m], (N, components); by default they stay.
            tolerance: Largest change in the last iteration over the size of the sheet.
            limit: Number of iterations.

        Raises:
            ArithmeticError: if Newton's method does not converge. Take smaller steps.
        """
        free, fixed = np.flatnonzero(~held.ravel()), np.flatnonzero(held.ravel())
        size = float(np.ptp(self.nodes, axis=0).max())
        for _ in range(limit):
            residual, tangent = self.assembled()
            self.iterations += 1
            change = np.zeros(self.displacement.size)
            if goal is not None:
                change[fixed] = (goal - self.displacement).ravel()[fixed]
            wanted = -(residual.ravel() + tangent @ change)[free]
            reduced = csc_matrix(tangent[free][:, free])
            factors = splu(reduced, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True})
            change[free] = factors.solve(wanted)
            largest = np.abs(change).max()
            if not np.isfinite(largest):
                break
            # A trial that moves by more than a fifth of the sheet is beyond what the tangent knows.
            factor = self._step(change.reshape(self.displacement.shape), min(1.0, 0.2 * size / largest))
            if factor == 1.0 and largest < tolerance * size:
                return
        raise ArithmeticError(f"no equilibrium after {self.iterations} iterations; take smaller steps")

    def _step(self, change: Array, factor: float) -> float:
        """Move by a part of a change, halved until no element of a plane sheet is inside out; returns the part."""
        before = self.displacement
        while True:
            self.displacement = before + factor * change
            if self.components == 3 or np.linalg.det(self.deformation()).min() > 0.0:
                return factor
            factor *= 0.5
            if factor < 1e-3:
                raise ArithmeticError("an element turns inside out; take smaller steps")


# Dynamics --------------------------------------------------------------------------------------------------------


@dataclass(eq=False)
class Motion:
    """A membrane on its way by central differences, with lumped mass:

        v' = [(1 - c dt/2) v + dt f / m] / (1 + c dt/2),   u' = u + dt v'.

    Attributes:
        membrane: Its elements.
        density: [kg/m^3].
        damping: c, by mass [1/s].
        held: Nodes with a given velocity, (N,).
        path: Time [s] -> velocity of the held nodes [m/s], (number of held nodes, 3).
        step: Longest step [s].
    """

    membrane: Membrane
    density: float
    damping: float
    held: Flags
    path: Callable[[float], Array]
    step: float
    time: float = 0.0
    velocity: Array = field(init=False)

    def __post_init__(self) -> None:
        self.velocity = np.zeros_like(self.membrane.displacement)

    @cached_property
    def masses(self) -> Array:
        """Of the nodes [kg], (N,)."""
        m = self.membrane
        parts = self.density * m.thickness * (m.weights[..., None] * m.shapes).sum(axis=1)
        return np.bincount(m.elements.ravel(), weights=parts.ravel())

    def touch(self, dt: float) -> None:
        """Change the velocity of nodes that touch something in a step dt [s]; nothing is there."""

    def run(self, until: float) -> None:
        """Go on to a time [s], in equal steps.

        Raises:
            ArithmeticError: if the displacement is not finite at the end.
        """
        steps = max(1, int(np.ceil((until - self.time) / self.step - 1e-9)))
        dt, begin = (until - self.time) / steps, self.time
        slower, faster = 1.0 - 0.5 * dt * self.damping, 1.0 + 0.5 * dt * self.damping
        for k in range(steps):
            # A first step from rest is a half kick.
            kick = 0.5 * dt if begin == 0.0 and k == 0 else dt
            self.velocity = (slower * self.velocity - kick * self.membrane.forces() / self.masses[:, None]) / faster
            self.velocity[self.held] = self.path(begin + (k + 0.5) * dt)
            self.touch(dt)
            self.membrane.displacement += dt * self.velocity
        self.time = until
        if not np.isfinite(self.membrane.displacement).all():
            raise ArithmeticError(f"the run diverged before {until:g} s; take a smaller step")
