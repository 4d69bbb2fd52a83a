"""What a uniaxial test says of equibiaxial tension: laws are fitted to it, and predict the other test.

A study of laws, without a sheet: nothing is chosen. Every law is fitted to uniaxial tension alone, and, where it was
tested, to uniaxial tension and pure shear; its nominal stress in equibiaxial tension is compared with the test.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from study import Row, picture, provenance, table
from treloar import BOUNDS, DATA, MATERIALS

from validation.comparison import deviations
from warp_pd.fitting import Curve, UniformTests, fit, nominal_stress, read_table

LAWS = (
    "neo-Hookean", "Mooney-Rivlin", "Ogden, two terms", "Gent", "Arruda-Boyce", "Yeoh", "Carroll", "extended tube",
)  # fmt: skip
RUBBERS = ("treloar", "kawabata", "meunier", "james", "kawamura")
KNOWN = (("uniaxial",), ("uniaxial", "planar"))
# Initial shear modulus of Treloar's rubber [Pa], for which the starts of MATERIALS are.
TYPICAL = 0.4e6
# Constants that are no moduli.
PURE = {"a1", "a2", "lock", "delta", "beta"}


def curves(rubber: str) -> dict[str, Curve]:
    """Tests of a rubber above a stretch of 1.1, by loading. Below it a reading is a tenth off."""
    columns = read_table(DATA.with_name(f"{rubber}.csv")).columns
    found = {}
    for loading in ("uniaxial", "planar", "equibiaxial"):
        if f"{loading}_stretch" in columns:
            stretch, stress = columns[f"{loading}_stretch"], columns[f"{loading}_stress"]
            known = np.isfinite(stretch) & (stretch > 1.1)
            found[loading] = Curve(loading, stretch[known], "nominal_stress", stress[known], name=loading)
    return found


def modulus(curve: Curve) -> float:
    """Modulus [Pa] from the first point of a uniaxial test."""
    stretch, stress = float(np.asarray(curve.at)[0]), float(np.asarray(curve.values)[0])
    return stress / (stretch - stretch**-2)


def fitted(tests: Mapping[str, Curve], law: str, known: Iterable[str]) -> Any:
    """A law, fitted to some of the tests of a rubber."""
    material, start = MATERIALS[law]
    softer = modulus(tests["uniaxial"]) / TYPICAL
    begin = {name: value if name in PURE else value * softer for name, value in start.items()}
    chosen = UniformTests(material, [tests[loading] for loading in known])
    found = fit(chosen, list(begin), start=begin, bounds=BOUNDS.get(law), max_evaluations=200)
    return material(*map(float, found.values))


def predictions(rubber: str, laws: Iterable[str] = LAWS) -> list[Row]:
    """Stresses of laws, for each set of tests that they are fitted to."""
    tests = curves(rubber)
    rows = []
    for known in (of for of in KNOWN if set(of) <= set(tests)):
        for law in laws:
            best = fitted(tests, law, known)
            stresses = {
                loading: [float(s) for s in nominal_stress(best, loading, np.asarray(curve.at))]
                for loading, curve in tests.items()
            }
            rows.append(
                {
                    "rubber": rubber,
                    "law": law,
                    "known": "-".join(known),
                    "off": {
                        loading: [round(float(x), 4) for x in deviations(stresses[loading], tests[loading].values)]
                        for loading in tests
                    },
                    "equibiaxial": [round(1e-6 * s, 5) for s in stresses["equibiaxial"]],
                }
            )
    return rows


def run() -> list[Row]:
    """All rubbers."""
    made = provenance("CPU")
    return [{**row, "made": made} for rubber in RUBBERS for row in predictions(rubber)]


def section(rows: list[Row]) -> list[str]:
    """Lines of the page: laws that know uniaxial tension."""
    known = "-".join(KNOWN[0])
    of = {(row["rubber"], row["law"]): row["off"] for row in rows if row["known"] == known}
    head = [f"fitted to {known}", *(rubber.capitalize() for rubber in RUBBERS)]
    cells = [[law, *(_cell(of[rubber, law], known) for rubber in RUBBERS)] for law in LAWS]
    return [
        *table(head, cells),
        "",
        "![Equibiaxial stress: test, and laws fitted to uniaxial tension](validation/spread.png)",
    ]


def _cell(off: dict[str, list[float]], known: str) -> str:
    fitted = max(float(np.median(np.abs(off[loading]))) for loading in known.split("-"))
    missed = f" ({100.0 * fitted:.0f} %)" if fitted > 0.05 else ""
    return f"{100.0 * np.median(off['equibiaxial']):+.0f} %{missed}"


def draw(path: Path, rows: list[Row]) -> None:
    """Equibiaxial stress of the tests, and of the laws that know uniaxial tension; the last panel has the legend."""
    with picture(path, 2, 3, size=(3.2, 2.4)) as axes:
        *panels, last = axes.flat
        for panel, rubber in zip(panels, RUBBERS, strict=True):
            test = curves(rubber)["equibiaxial"]
            measured = 1e-6 * np.asarray(test.values)
            panel.plot(test.at, measured, "ko", ms=4, label="test")
            for law in LAWS:
                (row,) = (r for r in rows if (r["rubber"], r["law"], r["known"]) == (rubber, law, "uniaxial"))
                panel.plot(test.at, row["equibiaxial"], lw=1.2, label=law)
            panel.set_ylim(0.0, 1.5 * measured.max())
            panel.set_title(rubber.capitalize(), fontsize=9)
            panel.set_xlabel("stretch, both ways", fontsize=8)
            panel.set_ylabel("nominal stress (MPa)", fontsize=8)
            panel.tick_params(labelsize=7)
        last.axis("off")
        last.legend(
            *panels[0].get_legend_handles_labels(), loc="center", fontsize=9, title="fitted to uniaxial tension"
        )
