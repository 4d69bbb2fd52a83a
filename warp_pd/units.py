"""Units as factors to SI, plain numbers: `thickness=0.5 * mm`, `mu=300 * kPa`, `density=0.95 * g_per_cm3`."""

import math

um, mm, cm, inch = 1e-6, 1e-3, 1e-2, 0.0254
us, ms, minute, hour = 1e-6, 1e-3, 60.0, 3600.0
mN, kN = 1e-3, 1e3
Pa, kPa, MPa, GPa, mbar, bar, psi = 1.0, 1e3, 1e6, 1e9, 1e2, 1e5, 6894.757293168361
mJ, kJ_per_m2, N_per_mm = 1e-3, 1e3, 1e3
mg, g, g_per_cm3, kg_per_m3 = 1e-6, 1e-3, 1e3, 1.0
degree = math.pi / 180.0
