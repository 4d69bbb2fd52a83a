"""The page."""

from __future__ import annotations

from study import bullet, paragraph

from .laws import HORIZON
from .runs import ENERGY_ERROR, SHARES
from .tables import difference_table, limits, origins, remarks, verdict_table
from .verdicts import Table

TITLE = "# Stability on stiff and extreme cases"


def page(cells: Table, numbers: str) -> str:
    """The page as markdown; `numbers` is the name of the file with the numbers."""
    devices = sorted({c.made.removeprefix("on ").split(",")[0] for row in cells.values() for c in row.values()})
    lines = [
        f"{TITLE}, {', '.join(devices)}",
        "",
        f"Made by `tools/stability`. The numbers are in [{numbers}]({numbers}).",
        "",
        *origins(cells),
        "",
        *meaning(),
        "## Limits, and what to do about them",
        "",
        "A star marks a law that needs a smaller step in some cases of a group.",
        "",
        *limits(cells),
        "",
        "## Verdicts, float32",
        "",
        *verdict_table(cells),
        "",
        "## Float32 against float64",
        "",
        *paragraph(
            "Largest difference of what the number is made of (stress, forces, displacement), over the largest value. "
            "Where motion is chaotic, the difference of the number itself."
        ),
        *difference_table(cells),
        "",
        "## Remarks",
        "",
        *remarks(cells),
        "",
    ]
    return "\n".join(lines)


def meaning() -> list[str]:
    """What the cells of the tables mean."""
    tried = ", ".join(f"{share:g}" for share in SHARES)
    return [
        "A cell holds a verdict and a number. The second column says what the number is.",
        "",
        *bullet("**stable**: at the default share of the estimated step, 0.9."),
        *bullet(f"**stable with a smaller step**: at the share of the estimate that follows. The shares are {tried}."),
        *bullet(
            "**diverges cleanly**: the run ends with a message and exit code 3, or the input is refused with a "
            "message. No NaN or Inf is written."
        ),
        *bullet(
            f"**wrong**: finite, but against physics: more than {100 * ENERGY_ERROR:g} % error of the energy balance "
            "(k above 1 for a law without an energy), more than 0.1 % in sheets of a few bonds, forces that do not "
            "turn with the sheet, a value that is not the exact one, modes without resistance. An error of the mean "
            "stress alone, such as the 2.2 % of published weights, is not wrong."
        ),
        *bullet("**n/a**: does not apply to the law; the remarks say why. An empty cell was not run."),
        "",
        *paragraph(
            "Energy errors are those of the balance, over the largest energy or work. For a law without an energy, k "
            "is the largest kinetic energy over the available energy. Long runs need an energy of every law: those "
            "without a potential are measured by the nodal energy of the same displacement, `visco bonds` by its own "
            "energy without what relaxes. Viscous sheets must lose energy. For them, gain is the largest rise of the "
            "energy from one twentieth of the run to the next, decrease of the loss, or drift of energy plus loss, "
            "over the kinetic energy of the start. The loss must never decrease while no bond breaks. Where bonds "
            "break the strain of the others jumps, and the balance decides."
        ),
        *paragraph(
            f"`published`, `plain` and `corrected` are weights of the bond-associated law, horizon {HORIZON}. `visco` "
            "is that law with corrected weights and two Prony terms. The other laws have their default horizons. "
            "`neural` is the network inside a kernel. `visco bonds` is the published law `ViscoBondBased` with the "
            "same Prony terms, which has a prestress, and `visco series` is the same with the printed update. "
            "`hyperelastic bonds` is the law `HyperelasticBonds` for equibiaxial stretch, incompressible."
        ),
    ]
