"""Identification of material constants from tests by simulation. See docs/fitting.md."""

from typing import TYPE_CHECKING

from ..device.lazy import lazy

if TYPE_CHECKING:
    from .columns import read_tests
    from .data import Curve, FieldData, read_table
    from .derivatives import Sensitivity, sensitivity
    from .least_squares import fit
    from .model import SceneTests
    from .probes import Deflection, PointField, Probe, SupportForce
    from .rates import RateTests, rate_stress
    from .report import Fit
    from .tearing import TearingFit, tearing_energy
    from .uniform import UniformTests, nominal_stress
else:
    __getattr__ = lazy(__name__)

__all__ = [
    "Curve",
    "Deflection",
    "FieldData",
    "Fit",
    "PointField",
    "Probe",
    "RateTests",
    "SceneTests",
    "Sensitivity",
    "SupportForce",
    "TearingFit",
    "UniformTests",
    "fit",
    "nominal_stress",
    "rate_stress",
    "read_table",
    "read_tests",
    "sensitivity",
    "tearing_energy",
]
