"""Whether points of the folding strip pass through its triangles, step by step, by exact arithmetic.

PYTHONPATH=tests python tools/folded_passing.py --steps 100000
"""

import argparse
import time

import numpy as np
from passing import passing

from warp_pd.__main__ import build_scene


def main():
    """Step the scene and look at every step."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--points", type=int, default=31)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--anew", type=int, default=2000, help="Steps after which the strip is dropped anew.")
    parser.add_argument("--damping", type=float, default=1.0)
    parser.add_argument("--without", action="store_true", help="Without self-contact.")
    options = parser.parse_args()
    scene = build_scene(
        "folded_sheet", {"points": options.points, "damping": options.damping, "self_contact": not options.without}
    )
    built, sheet = scene.build("cpu", 64), scene.sheet
    built.context.compile()
    drop(built, scene, 0)
    dt = 0.9 * built.solver.estimate(120)
    built.state.step.assign(np.array([dt]))
    step = built.context.sequence("step")
    before, found, begin = place(built, sheet), 0, time.time()
    for index in range(1, options.steps + 1):
        step.run()
        if index % options.anew == 0:
            drop(built, scene, index)
            before = place(built, sheet)
            continue
        after = place(built, sheet)
        pairs = passing(before, after, sheet.triangles)
        found += len(pairs)
        if pairs and found < 20:
            print(f"step {index}: {pairs[:4]}", flush=True)
        before = after
        if index % 5000 == 0:
            seconds = time.time() - begin
            print(f"{index} steps of {dt:.3g} s, {found} passed, {seconds:.0f} s", flush=True)


def drop(built, scene, seed):
    """Put the strip back to its start, with another velocity sideways."""
    x, rng = scene.sheet.points[:, 0] / 0.1, np.random.default_rng(seed)
    velocity = np.zeros((scene.sheet.size, 3))
    for k in range(1, 6):
        velocity[:, :2] += 0.1 * rng.normal(size=2) * np.sin(np.pi * k * x[:, None])
    built.state.displacement.assign(scene.initial_displacement)
    built.state.velocity.assign(velocity)
    for name in ("start", "setup"):
        built.context.run(name)


def place(built, sheet):
    """Positions [m], shape (N, 3)."""
    return sheet.positions + built.to_numpy(built.state.displacement)


if __name__ == "__main__":
    main()
