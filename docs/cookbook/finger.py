"""A glove finger, blown up, and a needle.

Follower pressure up to half of the load time, then a body on a path comes down. With `damage=TearingEnergy(...)` and
`Explicit` in place of `Newton` the needle goes through, as in `warp-pd run puncture`.
"""

from warp_pd import (
    BodyPath,
    BondAssociated,
    Fixed,
    Measure,
    MooneyRivlin,
    Newton,
    Outcome,
    Pressure,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
)


def build(points=24, reach=2e-3, pressure=2e3):
    """A glove finger, blown up first, and the blunt tip of a needle that comes down upon it; `points` around."""
    radius, length, thickness, mu, tip = 0.01, 0.08, 3e-4, 3e5, 5e-3
    sheet = Sheet.tube(radius, length, thickness=thickness, density=950.0, points=points)
    side = sheet.nearest(-radius, 0.0, 0.5 * length)
    # The stretch around of a long tube whose length is held: p R / h = mu (1 - stretch^-4).
    exact = (1.0 - pressure * radius / (thickness * mu)) ** -0.25
    begin = exact * radius + 0.5 * tip + 2e-4
    down = BodyPath([0.0, 0.5, 1.0], [(begin, 0.0, 0.5 * length)] * 2 + [(begin - reach, 0.0, 0.5 * length)])

    def stretch(built, frame):
        return -(sheet.points[side, 0] + frame.displacement[side, 0]) / radius

    return Simulation(
        sheet,
        BondAssociated(MooneyRivlin(0.5 * mu), horizon=2.015),
        Newton(load_steps=4),
        loads=[Fixed(sheet.edges("bottom", "top")), Pressure(pressure, ramp=[(0.0, 0.0), (0.5, 1.0)])],
        contact=RigidBody(Sphere(tip), down, name="needle"),
        measures=[Measure("stretch", "1", stretch)],
        outcomes=[
            Outcome("blown_up", "1", lambda rows: rows[len(rows) // 2]["stretch"], exact, "a long tube"),
            Outcome("needle", "N", lambda rows: rows[-1]["needle_force_x"]),
        ],
    )
