"""Compare what a step of each explicit scene costs with the best rate of this CPU at its horizon; prints a table.

    OMP_NUM_THREADS=1 taskset -c 0 python tools/scene_rates.py
    OMP_NUM_THREADS=1 taskset -c 0 python tools/scene_rates.py --scenes needle tube

Times are CPU time on one core, so that others may use the machine. A scene keeps its law, layout, precision and
features. Its sheet, as it is at the start, is stretched by 2 % in all directions and hardly moves: a slack sheet is
slower where tension field theory searches for its width. The best rate is that of a square lattice of the same horizon
without any feature: Gent by the bond-associated law for laws with intersections of families, one modulus by the
bond-based law for others. A cloud, whose horizon may grow with its spacing, is compared with the lattice of as many
bonds a point.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from time import process_time

from study import build_scene, run_tool, scene_names, study_parser, table, table_row

from warp_pd import Built, Explicit
from warp_pd.command.bench import STEP, Case
from warp_pd.device.cores import available_cores

STRETCH = 0.02
# Horizons of square lattices, and the bonds that their inner points have.
LATTICES = {1.5: 8, 2.015: 12, 2.25: 20, 2.9: 24, 3.015: 28, 3.2: 36}
HEAD = ["scene", "law", "layout", "points", "bonds a point", "horizon", "float", "us a point", "best", "times"]


@dataclass(frozen=True)
class Clock:
    """How steps are timed.

    Attributes:
        side: Points along a side of the sheet with the best rate.
        rounds: Number of measurements; the shortest counts.
        seconds: About how long each takes.
    """

    side: int = 101
    rounds: int = 5
    seconds: float = 0.2

    def cost(self, built: Built) -> float:
        """CPU time of a step a point [us]."""
        assert built.state.step is not None
        built.context.compile()
        built.state.step.fill_(STEP)
        built.set_clock(STEP, 1.0)
        displacement = built.state.displacement
        place = built.simulation.sheet.positions + built.context.initial_displacement
        stretched = built.context.initial_displacement + STRETCH * place
        displacement.assign(stretched.astype(displacement.numpy().dtype))
        built.context.run("start")
        built.context.run("setup")
        step = built.context.sequence("step")
        step.run()
        begin = process_time()
        step.run()
        inner = max(1, int(self.seconds / max(process_time() - begin, 1e-6)))
        best = float("inf")
        for _ in range(self.rounds):
            begin = process_time()
            for _ in range(inner):
                step.run()
            best = min(best, (process_time() - begin) / inner)
        return 1e6 * best / built.simulation.sheet.size

    @functools.cache  # noqa: B019
    def best(self, law: str, horizon: float, precision: int) -> float:
        """Cost of a point of an undamaged square lattice without features [us]."""
        return self.cost(Case(self.side, horizon, precision, law=law).simulation().build("cpu", precision))

    def row(self, name: str) -> list[str] | None:
        """Cells of a scene, or None if it has no explicit steps."""
        simulation = build_scene(name, {})
        solver = simulation.solver
        if not isinstance(solver, Explicit):
            return None
        built = simulation.build("cpu", solver.precision)
        families = built.law.families
        law = "bond_associated" if families.common.size else "bond_based"
        bonds = families.bond_count / simulation.sheet.size
        horizon = round(families.horizon / built.simulation.sheet.spacing, 3)
        if families.layout == "cloud":
            horizon = min(LATTICES, key=lambda known: abs(LATTICES[known] - bonds))
        found, reference = self.cost(built), self.best(law, horizon, solver.precision)
        return [
            name, built.law.owner, families.layout, f"{simulation.sheet.size}", f"{bonds:.0f}", f"{horizon:g}",
            f"{solver.precision}", f"{found:.3g}", f"{reference:.3g}", f"{found / reference:.2f}",
        ]  # fmt: skip


def main() -> None:
    """Measure and print."""
    parser = study_parser(__doc__)
    parser.add_argument("--scenes", nargs="+", default=scene_names(), choices=scene_names(), metavar="SCENE")
    options = parser.parse_args()
    if available_cores() != 1:
        parser.error("expected one core: start it with OMP_NUM_THREADS=1 taskset -c 0")
    print("\n".join(table(HEAD, [])))
    clock = Clock()
    for name in options.scenes:
        cells = clock.row(name)
        if cells is not None:
            print(table_row(cells), flush=True)


if __name__ == "__main__":
    run_tool(main)
