"""Cost of rigid bodies: seconds of a step with and without one, on a clamped square sheet.

    python tools/body_costs.py --points 1000 --triangles 10000 --device cuda

The body lies on the middle of the sheet: a sphere, the same as a mesh, and a free one; and a flat mesh, a lens, whose
bounding sphere has many points of the sheet in it. For meshes the tool also counts the points that search, by what they
remember: in the first step, and in later ones.
"""

import argparse
from time import perf_counter

import numpy as np
import warp as wp

from warp_pd import BodyPath, BondAssociated, Explicit, Fixed, Free, NeoHookean, RigidBody, Sheet, Simulation
from warp_pd.parts import Sphere, TriangleMesh


def sphere_mesh(diameter, triangles):
    """A sphere of about so many triangles."""
    around = max(8, round(np.sqrt(triangles)))
    rows = max(3, around // 2)
    polar = np.linspace(0.0, np.pi, rows + 1)[1:-1, None]
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[None]
    net = np.stack(
        [np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar) + 0.0 * angle], axis=-1
    ).reshape(-1, 3)
    vertices = 0.5 * diameter * np.vstack([[[0.0, 0.0, 1.0]], net, [[0.0, 0.0, -1.0]]])
    here, last = np.arange(around), len(vertices) - 1
    after, faces = (here + 1) % around, []
    faces.append(np.column_stack([0 * here, 1 + here, 1 + after]))
    for row in range(rows - 2):
        top, low = 1 + row * around, 1 + (row + 1) * around
        faces.append(np.column_stack([top + here, low + here, low + after]))
        faces.append(np.column_stack([top + here, low + after, top + after]))
    low = 1 + (rows - 2) * around
    faces.append(np.column_stack([low + here, 0 * here + last, low + after]))
    return TriangleMesh(vertices, np.vstack(faces).astype(np.int32))


def ready(sheet, contact, device):
    """A simulation before its first step."""
    simulation = Simulation(
        sheet, BondAssociated(NeoHookean(1e5, 1e7), horizon=3.15), Explicit(1.0, step=1e-7),
        loads=[Fixed(sheet.edges("all"))], contact=contact,
    )  # fmt: skip
    built = simulation.build(device, 32)
    built.context.compile()
    for name in ("start", "setup"):
        built.context.run(name)
    built.state.step.assign(np.array([1e-7], np.float32))
    built.set_clock(1e-7, 1.0, 0.0)
    return built


def seconds_of_a_step(sheet, contact, device, steps):
    """Mean over some steps [s]."""
    ten = ready(sheet, contact, device).context.sequence("step", repeat=10)
    for _ in range(3):
        ten.run()
    wp.synchronize()
    begin = perf_counter()
    for _ in range(steps // 10):
        ten.run()
    wp.synchronize()
    return (perf_counter() - begin) / (steps // 10 * 10)


def searches(sheet, contact, device, steps=20):
    """Points in the bounding sphere of the body, points that search in the first step, and in a later one (mean)."""
    context = ready(sheet, contact, device).context
    one, seen, found = context.sequence("step"), context.fields["body_seen"], []
    before = seen.numpy().copy()
    for _ in range(steps):
        one.run()
        now = seen.numpy()
        found.append(int((now != before).any(axis=1).sum()))
        before = now.copy()
    places = sheet.positions + context.state.displacement.numpy() - context.fields["body_place"].numpy()[0]
    near = int((np.linalg.norm(places, axis=1) < contact.shape.radius()).sum())
    return near, found[0], float(np.mean(found[1:]))


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=1000, help="along a side")
    parser.add_argument("--triangles", type=int, default=10000)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--device", default=None)
    parser.add_argument("--cases", nargs="*", default=[""], help="only those whose name contains one of these")
    given = parser.parse_args()
    sheet = Sheet.rectangle(1.0, 1.0, thickness=1e-3, density=1000.0, points=given.points)
    mesh, ball = sphere_mesh(0.4, given.triangles), Sphere(0.4)
    # It rolls over the sheet at 0.1 m/s, pressed in by a micrometre a step.
    path = BodyPath([0.0, 1.0], [(0.5, 0.5, 0.2001), (0.6, 0.5, -9.8)])
    lens = TriangleMesh(mesh.vertices * [1.0, 1.0, 0.2], mesh.triangles)
    low = BodyPath([0.0, 1.0], [(0.5, 0.5, 0.0401), (0.6, 0.5, -9.96)])
    cases = {
        "no body": None,
        "sphere": RigidBody(ball, path),
        "sphere, friction": RigidBody(ball, path, friction=0.3),
        f"mesh of {len(mesh.triangles)}": RigidBody(mesh, path),
        f"mesh of {len(mesh.triangles)}, friction": RigidBody(mesh, path, friction=0.3),
        f"lens of {len(mesh.triangles)}": RigidBody(lens, low),
        "free sphere": RigidBody(ball, Free(0.1, (0.5, 0.5, 0.2001), (0.0, 0.0, -10.0))),
        f"free mesh of {len(mesh.triangles)}": RigidBody(mesh, Free(0.1, (0.5, 0.5, 0.2001), (0.0, 0.0, -10.0))),
    }
    cases = {name: it for name, it in cases.items() if it is None or any(part in name for part in given.cases)}
    for name, contact in cases.items():
        if "lens" in name or (name.startswith("mesh") and contact.friction == 0.0):
            near, first, later = searches(sheet, contact, given.device)
            print(
                f"{name:32s} {near} points in its bounding sphere; {first} search in the first step, {later:.1f} later",
                flush=True,
            )
    none = None
    for name, contact in cases.items():
        taken = seconds_of_a_step(sheet, contact, given.device, given.steps)
        none = none or taken
        print(f"{name:32s} {1e6 * taken:10.1f} us a step, {100.0 * (taken / none - 1.0):+6.1f} %", flush=True)


if __name__ == "__main__":
    main()
