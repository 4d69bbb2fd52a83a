"""Cost of self-contact in a step, and whether its bits repeat: `python tools/self_contact_cost.py --points 1000`."""

import argparse
import time

import numpy as np
import warp as wp

from warp_pd import BondAssociated, CriticalStretch, Explicit, NeoHookean, SelfContact, Sheet, Simulation

MATERIAL = NeoHookean(mu=1e6, bulk=1e8)


def sheet_of(points):
    """A square lattice of spacing 1 mm."""
    return Sheet.rectangle(1e-3 * (points - 1), 1e-3 * (points - 1), thickness=1e-3, density=1000.0, points=points)


def states(sheet):
    """Initial displacement and velocity of each case, by name."""
    at_rest, x = np.zeros((sheet.size, 3)), sheet.points[:, 0]
    moving = np.tile([0.0, 0.0, 10.0], (sheet.size, 1))
    middle = x.max() / 2
    folded = at_rest.copy()
    over = x > middle
    folded[over, 0] = (2.0 * middle - 2.0 * x + 0.5 * sheet.spacing)[over]
    folded[over, 2] = 1.25 * sheet.spacing
    return {"flat, at rest": (at_rest, at_rest), "flat, at 10 m/s": (at_rest, moving), "folded": (folded, moving)}


def timed(sheet, horizon, state, contact, damage, device, steps):
    """Milliseconds per step, and the displacement after them."""
    displacement, velocity = state
    built = Simulation(
        sheet, BondAssociated(MATERIAL, horizon=horizon, weights="plain"), Explicit(1.0), contact=contact,
        damage=damage, initial_displacement=displacement, initial_velocity=velocity,
    ).build(device, 32)  # fmt: skip
    built.context.compile()
    for name in ("start", "setup"):
        built.context.run(name)
    built.state.step.assign(np.array([5e-7], np.float32))
    ten = built.context.sequence("step", repeat=10)
    ten.run()
    wp.synchronize()
    best = np.inf
    for _ in range(3):
        begin = time.perf_counter()
        for _ in range(steps // 10):
            ten.run()
        wp.synchronize()
        best = min(best, 1e3 * (time.perf_counter() - begin) / (10 * (steps // 10)))
    for each in built.contacts:
        each.end_frame()
    return best, built.state.displacement.numpy()


def main():
    """Print one line a case."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--points", type=int, default=1000, help="Points along each edge.")
    parser.add_argument("--device", default=None)
    parser.add_argument("--steps", type=int, default=200)
    options = parser.parse_args()
    sheet = sheet_of(options.points)
    for horizon in (3.15, 2.015):
        for damage in (None, CriticalStretch(9.0)):
            for name, state in states(sheet).items():
                found = [
                    timed(sheet, horizon, state, contact, damage, options.device, options.steps)
                    for contact in (None, SelfContact(), SelfContact(), SelfContact(friction=0.3))
                ]
                (without, _), (smooth, one), (_, again), (rough, _) = found
                same = "same bits" if np.array_equal(one, again) else "OTHER BITS"
                print(
                    f"{sheet.size} points, horizon {horizon}, {'breakable' if damage else 'unbreakable'}, {name}: "
                    f"{without:.4f} ms without, {smooth:.4f} with ({100 * (smooth / without - 1):+.1f} %), "
                    f"{rough:.4f} with friction ({100 * (rough / without - 1):+.1f} %); {same}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
