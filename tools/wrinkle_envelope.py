"""How long are the wrinkles of the strip of scenes/wrinkles.py, and how wide, by its tension field?

    python tools/wrinkle_envelope.py --points 81

In the tension field a wrinkled family is narrower than in uniaxial tension by the fraction d. Wrinkles of the wave
number k take this up with slopes s = sqrt(2 d), amplitudes s / k. Of the bending D k^2 s^2 across them and the tension
T (ds/dx)^2 / k^2 along them the sum is least at k^4 = (T / D) <(ds/dx)^2> / <s^2>. Cerda and Mahadevan take s for a
half sine over the whole length. Prints the numbers of docs/bending.md.
"""

from __future__ import annotations

import numpy as np
from study import at_least_one, device_title, provenance, run_tool, study_parser, table

from warp_pd import BondAssociated, Fixed, MooneyRivlin, Motion, Newton, Sheet, Simulation, TensionField
from warp_pd.scenes.wrinkles import LENGTH, MU, WIDTH

STRAIN = 0.1


def envelope(points: int, device: str | None = "cpu") -> tuple[np.ndarray, np.ndarray]:
    """Places along the stretched strip [m], and the root mean square slope of its wrinkles across them [-]."""
    spacing = LENGTH / (points - 1)
    rows = round(WIDTH / spacing) + 1
    sheet = Sheet.rectangle(LENGTH, (rows - 1) * spacing, thickness=7e-5, density=1000.0, points=points)
    left, right = sheet.edges("left"), sheet.edges("right")
    flat = np.setdiff1d(np.arange(sheet.size), np.concatenate([left, right]))
    result = Simulation(
        sheet,
        BondAssociated(TensionField(MooneyRivlin(0.5 * MU)), horizon=1.5),
        Newton(tolerance=1e-6, load_steps=2),
        loads=[Fixed(left), Motion(right, [0.0, 1.0], x=[0.0, STRAIN * LENGTH], y=0.0, z=0.0), Fixed(flat, "z")],
        fields=("stretch",),
    ).run(device=device, precision=64)
    assert result.status == "finished", result.summary["message"]
    along, across = (result.frame.point_data[f"stretch_{k}"].reshape(rows, -1) for k in (1, 2))
    missing = np.clip(1.0 - across * np.sqrt(along), 0.0, None)
    place = (sheet.points[:, 0] + result.frame.displacement[:, 0]).reshape(rows, -1)
    return place.mean(axis=0), np.sqrt(2.0 * missing.mean(axis=0))


def over_half_sine(place: np.ndarray, slope: np.ndarray) -> float:
    """Wavelength of least energy over that of a half sine over the whole length."""
    change = np.trapezoid(np.gradient(slope, place) ** 2, place) / np.trapezoid(slope**2, place)
    return float((np.pi / np.ptp(place)) ** 0.5 / change**0.25)


def main() -> None:
    """Print the envelope and the wavelength."""
    parser = study_parser(__doc__, device=None)
    parser.add_argument("--points", type=at_least_one, default=81)
    options = parser.parse_args()
    place, slope = envelope(options.points, options.device)
    lines = [[f"{x / place[-1]:.3f}", f"{s:.4f}"] for x, s in zip(place, slope, strict=True)][:: options.points // 20]
    print("\n".join(table(["place over length", "slope"], lines)))
    print(f"\nwavelength over Cerda and Mahadevan's: {over_half_sine(place, slope):.3f}")
    print(provenance(device_title(options.device)))


if __name__ == "__main__":
    run_tool(main)
