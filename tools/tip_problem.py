"""What does the tip of a tear take on a lattice, in static equilibrium?

    python tools/tip_problem.py                                     the table of docs/tearing.md, 10 minutes on one core
    python tools/tip_problem.py --horizons 2.015 --lengths 4        one of its rows
    python tools/tip_problem.py --horizons 2.015 --lengths 4 --along 0.8    of Mooney-Rivlin rubber with c01 = c10 / 4
    python tools/tip_problem.py --horizons 2.015 --lengths 4 --across       only bonds across the tear break
    python tools/tip_problem.py --horizons 2.015 --lengths 4 --pull 0.1     the sheet is pulled along the tear, too

The problem that the correction `bias` of warp_pd/tearing/field_constants.py answers, with nothing fitted: a long strip
on a lattice of spacing 1, held along both long edges, with a crack along its middle. Families, intersections, weights,
damage field and the rules by which bonds break are those of the product. Stretches are large, so that the sheet, which
is neo-Hookean beyond its strength, stores mu |grad u|^2 / 2 with the displacement u across the crack alone. The
equations are linear, and G = (energy of a column far ahead) times the square of the opening. Displacement and damage
are minimised in turn. The strip is opened until bonds break, closed a little, opened again: the tear goes on column by
column.

Numbers are divided by the tearing energy Gc of the field:

    first       G at which the first bond breaks, of a cut that begins as in a sheet
    with cap    the same, of a cut whose damage reaches pi / 4 lengths beyond its tip
    taken       energy of the field, and energy lost when bonds break, per new area of a steady tear: less cannot do
    needed      G at which a steady tear goes on without inertia, over the barrier of each column
    bias        the correction
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu
from study import in_processes, run_tool, study_parser, table, table_row

from warp_pd.kernels.kinematics import SAMPLE
from warp_pd.kernels.tearing.damage_field import NEAR, NEARLY, PASSED, PASSED_END
from warp_pd.tearing.cut_profiles import _cap
from warp_pd.tearing.damage_field import GROWN, MOST_AT_START, SEVERED
from warp_pd.tearing.field_constants import bias

# Length of the strip and the place of the tip along it, in heights.
LONG, TIP = 2.2, 0.9
# Relative step of G, factor on G when bonds have broken, and change of the damage that is none.
STEP, BACK, SETTLED = 4e-3, 0.96, 1e-3
# Columns by which a tear grows, and those after which it is steady.
GROWTH, STEADY = 14, 6


@dataclass(frozen=True)
class Family:
    """The family of a point of the lattice.

    Attributes:
        bonds: Its bonds, (M, 2).
        influence: Influence of each, (M,).
        common: Whether bond k belongs to the intersection of bond j, (j, k).
        weights: Weight of each intersection, (M,).
        beside: Whether a severed member k breaks bond j, (j, k).
    """

    bonds: np.ndarray
    influence: np.ndarray
    common: np.ndarray
    weights: np.ndarray
    beside: np.ndarray

    @staticmethod
    def of(horizon: float) -> Family:
        """The family of a horizon in spacings."""
        steps = np.arange(-int(horizon), int(horizon) + 1)
        bonds = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        squared = (bonds**2).sum(axis=1)
        bonds = bonds[(squared > 0) & (squared <= horizon**2)]
        squared, along = (bonds**2).sum(axis=1), bonds @ bonds.T
        common = squared[:, None] + squared - 2 * along <= horizon**2 + 1e-9
        between = (squared < squared[:, None]) & (squared < 2 * along)
        off = squared - along**2 / squared[:, None]
        sizes = common.sum(axis=1)
        return Family(bonds, 1.0 - np.sqrt(squared) / horizon, common, sizes / sizes.sum(), between & (off < NEAR**2))


class Strip:
    """The upper half of the strip; the lower one is its mirror image, with the opposite displacement.

    Attributes:
        damage: Damage of the points, (N,).
        alive: Intact bonds, (N, M).
        released: Energy lost when bonds broke, of both halves.
    """

    def __init__(
        self,
        horizon: float,
        length: float,
        rows: int,
        tip: float | None,
        recess: float,
        columns: int,
        along: float = 1.0,
        across: bool = False,
        pull: float = 0.0,
    ) -> None:
        """A strip of twice so many rows, with a crack to `tip` and damage to `recess` before it, or without ends.

        `across`: only bonds across the crack break. `pull`: energy density that a uniform tension along the crack
        stores, over that of the strength.
        """
        self.family, self.length, self.along, self.across = Family.of(horizon), length, along, across
        self.pull = pull
        bonds = self.family.bonds
        column, row = np.meshgrid(np.arange(columns), np.arange(rows))
        self.x, self.y, self.size = column.ravel().astype(float), row.ravel() + 0.5, columns * rows
        there, up = column.reshape(-1, 1) + bonds[:, 0], row.reshape(-1, 1) + bonds[:, 1]
        exists = np.ones(there.shape, bool) if tip is None else (there >= 0) & (there < columns)
        # Beyond the clamp the sheet is rigid.
        self.members = np.minimum(np.where(up < 0, -1 - up, up), rows - 1) * columns + there % columns
        self.members[~exists] = 0
        self.sign = np.where(up < 0, -1.0, 1.0)
        crossing = self.x[:, None] - bonds[:, 0] * self.y[:, None] / np.where(bonds[:, 1] == 0, 1, bonds[:, 1])
        self.initial = exists & ~((up < 0) & (crossing < (-np.inf if tip is None else tip)))
        self.alive, self.exists = self.initial.copy(), exists
        self.clamp = self.y > rows - 1.0
        self.damage, self.released = np.zeros(self.size), 0.0
        self.severed_at = np.full(self.size, SEVERED * (1.0 - 0.25 / length) ** 2)
        self.ahead = np.zeros(self.size, bool)
        if tip is not None:
            apart = np.hypot(np.maximum(self.x - tip + recess, 0.0), self.y)
            self.damage = np.minimum(np.maximum(1.0 - apart / (2.0 * length), 0.0) ** 2, MOST_AT_START)
            self.ahead = (self.x > tip - recess) & (self.damage + GROWN > self.severed_at)
            self.severed_at = np.maximum(self.severed_at, self.damage + GROWN)
        entries = np.concatenate([np.arange(self.size)[:, None], self.members], axis=1)
        self.entries = entries
        pairs = entries[:, :, None].astype(np.int64) * self.size + entries[:, None, :]
        self.places, self.inverse = np.unique(pairs, return_inverse=True)
        self.stiffness = np.empty((self.size, len(bonds) + 1, len(bonds) + 1))
        self.whole = self.shape(self.initial)[3]
        self.renew(np.arange(self.size))
        self.beside = self.neighbours(column.ravel(), row.ravel(), columns, rows)
        self.degree = np.asarray(self.beside.sum(axis=1)).ravel()
        self.displacement = np.where(self.clamp, 0.5, 0.0)

    def neighbours(self, column: np.ndarray, row: np.ndarray, columns: int, rows: int) -> csr_matrix:
        """Which points of the half are neighbours, (N, N)."""
        pairs = []
        for along, across in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            a, b = column + along, row + across
            there = (a >= 0) & (a < columns) & (b >= 0) & (b < rows)
            pairs.append(np.stack([np.flatnonzero(there), (b * columns + a)[there]]))
        first, second = np.concatenate(pairs, axis=1)
        return csr_matrix((np.ones(len(first)), (first, second)), (self.size, self.size))

    def shape(self, alive: np.ndarray) -> tuple[np.ndarray, ...]:
        """Shape tensors (11, 12, 22) of all intersections and their determinants, each (N, M)."""
        x, y = self.family.bonds.T
        shared = (alive[:, None, :] & self.family.common) * self.family.influence
        first, mixed, second = shared @ (x * x), shared @ (x * y), shared @ (y * y)
        return first, mixed, second, first * second - mixed**2

    def renew(self, points: np.ndarray) -> None:
        """Stiffness of the families of some points, (M + 1, M + 1) each: their energy is u . K u / 2."""
        family, alive = self.family, self.alive[points]
        first, mixed, second, determinant = self.shape(alive)
        there = alive & (determinant >= SAMPLE * self.whole[points])
        factor = np.sqrt(family.weights) * there / np.where(there, determinant, 1.0)
        x, y = family.bonds.T
        shared = (alive[:, None, :] & family.common) * family.influence
        gradient = np.zeros((len(points), 2, len(x), len(x) + 1))
        gradient[:, 0, :, 1:] = factor[:, :, None] * shared * (x * second[..., None] - y * mixed[..., None])
        gradient[:, 1, :, 1:] = factor[:, :, None] * shared * (y * first[..., None] - x * mixed[..., None])
        gradient[:, 0] *= np.sqrt(self.along)
        gradient[..., 0] = -gradient[..., 1:].sum(axis=3)
        gradient[..., 1:] *= self.sign[points][:, None, None, :]
        gradient = gradient.reshape(len(points), -1, len(x) + 1)
        self.stiffness[points] = gradient.transpose(0, 2, 1) @ gradient

    def energies(self) -> np.ndarray:
        """Energy of each family without its damage at an opening of 1, (N,)."""
        local = self.displacement[self.entries]
        return 0.5 * np.einsum("ni,nij,nj->n", local, self.stiffness, local)

    def balance(self) -> np.ndarray:
        """Find the displacement at an opening of 1; return the energies of the families."""
        left = (1.0 - self.damage) ** 2
        values = np.bincount(self.inverse.ravel(), (left[:, None, None] * self.stiffness).ravel())
        matrix = csr_matrix((values, (self.places // self.size, self.places % self.size)), (self.size, self.size))
        free, held = np.flatnonzero(~self.clamp), np.flatnonzero(self.clamp)
        # A point that has lost all its bonds stays where it is.
        some = csr_matrix((np.full(len(free), 1e-9), (np.arange(len(free)),) * 2))
        force = -0.5 * np.asarray(matrix[free][:, held].sum(axis=1)).ravel()
        self.displacement[free] = solved(matrix[free][:, free] + some, force)
        return self.energies()

    def heal_nothing(self, driving: np.ndarray) -> float:
        """Find the least damage above the present one; return its largest change. `driving` is 8 l Y / (3 Gc), (N,)."""
        before, coupling = self.damage, 2.0 * self.length**2
        # At the strength `driving` is a half.
        driving = driving + 0.5 * self.pull
        able = (before > 0.0) | (2.0 * driving > 0.3)
        for _ in range(3):
            able = able | (self.beside @ able > 0.0)
        able &= ~self.clamp

        def slope(damage: np.ndarray) -> np.ndarray:
            return 2.0 * driving * (1.0 - damage) - 1.0 - coupling * (self.degree * damage - self.beside @ damage)

        free, damage = able & (slope(before) > 0.0), before
        for _ in range(60):
            grow, damage = np.flatnonzero(free), before.copy()
            if len(grow):
                own = (
                    csr_matrix((2.0 * driving[grow] + coupling * self.degree[grow], (np.arange(len(grow)),) * 2))
                    - coupling * self.beside[grow][:, grow]
                )
                rest = np.where(free, 0.0, before)
                damage[grow] = solved(own, 2.0 * driving[grow] - 1.0 + coupling * (self.beside[grow] @ rest))
            new = np.where(free, damage >= before - 1e-13, able & (slope(damage) > 1e-10))
            if (new == free).all():
                break
            free = new
        self.damage = np.clip(damage, before, 1.0)
        return float((self.damage - before).max())

    def breaks(self) -> bool:
        """Break bonds where the damage is large enough; return whether any broke."""
        lost = 1.0 - self.alive.sum(axis=1) / self.initial.sum(axis=1)
        passed = (self.damage < self.severed_at) & (self.damage > NEARLY * self.severed_at)
        passed &= lost >= np.where(self.ahead, PASSED_END, PASSED)
        self.severed_at[passed] = self.damage[passed]
        severed = self.damage >= self.severed_at
        there = severed[self.members] & self.exists
        broken = severed[:, None] | there | (((there & self.initial) @ self.family.beside.T.astype(float)) > 0.0)
        if self.across:
            broken &= self.sign < 0.0
        changed = (self.alive & broken).any(axis=1)
        self.alive &= ~broken
        if changed.any():
            self.renew(np.flatnonzero(changed))
        return bool(changed.any())

    def field(self) -> float:
        """Energy of the field over Gc, both halves."""
        pairs = self.beside.tocoo()
        steps = ((self.damage[pairs.row] - self.damage[pairs.col]) ** 2).sum()
        return float(0.75 * self.damage.sum() / self.length + 0.375 * self.length * steps)

    def tip(self) -> float:
        """Where the tear ends."""
        torn = (self.damage >= self.severed_at) & (self.y < 1.0)
        return float(self.x[torn].max(initial=-1.0))


def solved(matrix: csr_matrix, right: np.ndarray) -> np.ndarray:
    """Solution of a symmetric system."""
    factors = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.asarray(factors.solve(right))


def grown(
    horizon: float,
    length: float,
    height: float,
    recess: float,
    growth: int = GROWTH,
    along: float = 1.0,
    across: bool = False,
    pull: float = 0.0,
) -> np.ndarray:
    """A tear that grows: growth in columns, G at which bonds broke, energy of the field, and energy lost; (n, 4)."""
    half = round(0.5 * height * length)
    begin = int(2.0 * TIP * half) + 0.5
    uniform = Strip(horizon, length, half, None, 0.0, 1, along)
    per_column = 2.0 * uniform.balance().sum()
    strip = Strip(horizon, length, half, begin, recess, int(2.0 * LONG * half) + growth, along, across, pull)
    rate, rows, advance = 0.9, [], 0.0
    while advance < growth:
        rate *= 1.0 + STEP
        while True:
            energies = strip.balance()
            settled = strip.heal_nothing(8.0 * length / 3.0 * rate / per_column * energies) < SETTLED
            if settled or ((strip.damage >= strip.severed_at) & strip.alive.any(axis=1)).any():
                break
        at = rate
        while True:
            left = 2.0 * (1.0 - strip.damage) ** 2 * rate / per_column
            if not strip.breaks():
                break
            strip.released += float(left @ (energies - strip.energies()))
            rate *= BACK
            energies = strip.balance()
            strip.heal_nothing(8.0 * length / 3.0 * rate / per_column * energies)
        if strip.tip() > begin + advance:
            advance = strip.tip() - begin + 0.5
            rows.append((advance, at, strip.field(), strip.released))
    return np.array(rows)


def row(horizon: float, length: float, height: float, along: float, across: bool, pull: float) -> dict[str, float]:
    """Numbers of a horizon and a length of the field, in spacings, in a strip of a height in lengths."""
    rows = grown(horizon, length, height, length * _cap(length, True), GROWTH, along, across, pull)
    steady = rows[rows[:, 0] >= STEADY]
    return {
        "first": float(rows[0, 1]),
        "with cap": float(grown(horizon, length, height, 0.0, 1, along, across, pull)[0, 1]),
        "taken": float(np.polyfit(steady[:, 0], steady[:, 2] + steady[:, 3], 1)[0]),
        "needed": float(steady[:, 1].mean()), "bias": bias(horizon / length),
    }  # fmt: skip


def main() -> None:
    """Solve the problems and print the table."""
    parser = study_parser(__doc__, jobs=1)
    parser.add_argument("--horizons", type=float, nargs="+", default=[1.5, 2.015, 3.15], help="in spacings")
    parser.add_argument("--lengths", type=float, nargs="+", default=[4.0, 6.0], help="of the field, in spacings")
    parser.add_argument("--height", type=float, default=10.0, help="of the strip, in lengths")
    parser.add_argument("--along", type=float, default=1.0, help="stiffness along the tear over that across it")
    parser.add_argument("--across", action="store_true", help="only bonds across the tear break")
    parser.add_argument("--pull", type=float, default=0.0, help="energy of a tension along the tear over the strength")
    options = parser.parse_args()
    strip = (options.height, options.along, options.across, options.pull)
    cases = [(m, length, *strip) for length in options.lengths for m in options.horizons]
    print("\n".join(table(["horizon", "length", "first", "with cap", "taken", "needed", "bias"], [])))
    for (m, length, *_), found in in_processes(row, cases, options.jobs):
        print(table_row([f"{m:g}", f"{length:g}", *(f"{value:.3f}" for value in found.values())]), flush=True)


if __name__ == "__main__":
    run_tool(main)
