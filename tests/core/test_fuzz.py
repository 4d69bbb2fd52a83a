"""Random wrong arguments of the public API: each is refused in one line, or the simulation can be built."""

import inspect
import os

import numpy as np
from helpers import NEO, square
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import warp_pd
from warp_pd import BondAssociated, Explicit, Fixed, InputError, Sheet, Simulation

EXAMPLES = int(os.environ.get("WARP_PD_FUZZ", "150"))
SHEET = square(9)
EDGE = SHEET.edges("left")
NAN, INF = float("nan"), float("inf")
ODD = [
    None, True, 0, -1, 3, 0.5, NAN, INF, -INF, 1e308, 1e-308, "", "x", "plain", [], [1, 2], (0.0, 1.0), (0.0, 0.0, 1.0),
    {}, {"a": 1}, EDGE, np.zeros(0), np.zeros((2, 3)), np.array(["a"]), np.full(3, NAN), object(), Fixed, NEO, SHEET,
    lambda *given: 0.0, 10**30, 1j, b"x",
]  # fmt: skip
# A valid value for every argument that has no default.
VALID = {
    "width": 0.1, "height": 0.1, "thickness": 1e-3, "density": 1000.0, "points": EDGE, "mu": 1e3, "bulk": 1e5,
    "lock": 20.0, "material": NEO, "duration": 0.1, "stretch": 2.0, "energy": 5.0, "diameter": 0.05,
    "start": (0.05, 0.05, 0.03), "times": [0.0, 1.0], "force": (0.0, 0.0, 1e-3), "value": 1.0, "c10": 500.0,
    "c01": 100.0, "coefficients": (600.0,), "exponents": (2.0,), "chain": 5.0, "tension": 1e3, "x": 0.0,
    "moduli": (600.0,), "principal": 1e5, "length": 0.1, "section": 1e-6, "acceleration": (0.0, 0.0, -9.81),
}  # fmt: skip
PARTS = {
    name: getattr(warp_pd, name)
    for name in (
        "Fixed", "Motion", "PointForce", "Pressure", "BodyForce", "RigidBall", "CriticalStretch", "CriticalEnergy",
        "CriticalEnergyDensity", "CriticalStress", "TearingEnergy",
        "ArcLength", "Explicit", "Newton", "Relaxation", "BondAssociated", "Nodal", "BondBased",
        "NeoHookean", "Gent", "MooneyRivlin", "Yeoh", "Ogden", "ArrudaBoyce", "TensionField", "Measure", "Outcome",
    )
}  # fmt: skip


@st.composite
def calls(draw):
    """A class or a constructor of sheets, and keyword arguments of which one to three are odd."""
    name = draw(st.sampled_from([*PARTS, "rectangle", "filled", "line", "from_points"]))
    called = PARTS.get(name) or getattr(Sheet, name)
    parameters = list(inspect.signature(called).parameters.values())
    arguments = {}
    for parameter in parameters:
        if parameter.default is inspect.Parameter.empty:
            arguments[parameter.name] = VALID.get(parameter.name, 1.0)
    if name in ("rectangle", "filled", "line", "from_points"):
        arguments["points"] = SHEET.points if name == "from_points" else 9
    for parameter in draw(st.lists(st.sampled_from(parameters), min_size=1, max_size=3)):
        arguments[parameter.name] = draw(st.sampled_from(ODD))
    return name, called, arguments


def used(name, made):
    """A simulation that uses what was made."""
    values = {"sheet": SHEET, "force": BondAssociated(NEO), "solver": Explicit(0.1)}
    if isinstance(made, Sheet):
        values["sheet"] = made
    elif name in ("ArcLength", "Explicit", "Newton", "Relaxation"):
        values["solver"] = made
    elif name in ("BondAssociated", "Nodal", "BondBased"):
        values["force"] = made
    elif name == "RigidBall":
        values["contact"] = made
    elif name in ("CriticalStretch", "CriticalEnergy", "CriticalEnergyDensity", "CriticalStress", "TearingEnergy"):
        values["damage"] = made
    elif name in ("Measure", "Outcome"):
        values[f"{name.lower()}s"] = [made]
    elif name in ("Fixed", "Motion", "PointForce", "Pressure", "BodyForce"):
        values["loads"] = [made]
    else:
        values["force"] = BondAssociated(made)
    return Simulation(**values)


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))
@given(calls())
@example(("TearingEnergy", warp_pd.TearingEnergy, {"energy": 5.0, "strength": 1e-308}))
def test_wrong_arguments_are_one_line_or_can_be_built(call):
    name, called, arguments = call
    try:
        used(name, called(**arguments)).build("cpu")
    except InputError as error:
        assert "\n" not in str(error) and len(str(error)) < 720, error
