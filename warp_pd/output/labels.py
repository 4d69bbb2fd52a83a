"""What pictures call the fields of frames and the columns of the history, with units."""

from __future__ import annotations

# Words and unit of point fields; those of the components of a field that is no vector in space, by number.
FIELDS = {
    "displacement": ("displacement", "m"),
    "velocity": ("velocity", "m/s"),
    "damage": ("damage", ""),
    "strain_energy_density": ("strain energy density", "J/m\u00b3"),
    "stretch_1": ("largest principal stretch", ""),
    "stretch_2": ("smallest principal stretch", ""),
    "first_piola_1": ("largest first Piola stress", "Pa"),
    "first_piola_2": ("smallest first Piola stress", "Pa"),
    "cauchy_1": ("largest Cauchy stress", "Pa"),
    "cauchy_2": ("smallest Cauchy stress", "Pa"),
    "wrinkle_state": ("wrinkle state", "0 taut, 1 wrinkled, 2 slack"),
    "wrinkle_level": ("wrinkle level", ""),
    "principal_stress_1": ("largest principal stress", "Pa"),
    "principal_stress_2": ("smallest principal stress", "Pa"),
    "principal_stress_3": ("angle of the largest principal stress", "rad"),
}
COLUMNS = {
    "kinetic": "kinetic energy",
    "strain": "strain energy",
    "external": "work of loads and supports",
    "damping": "lost to damping",
    "rupture": "lost to broken bonds",
    "viscous": "lost to viscosity",
    "contact": "energy of the contact",
    "sheet_friction": "lost to friction of the sheet",
}
ENERGIES = tuple(COLUMNS)
UNITS = {
    "force": "N", "torque": "N m", "position": "m", "velocity": "m/s", "spin": "rad/s", "pressure": "Pa",
    "volume": "m\u00b3", "potential": "J", "kinetic": "J", "loss": "J", "rubbed": "J",
}  # fmt: skip


def field_label(name: str) -> str:
    """Name and unit of a point field, such as "displacement along z (m)" for u3."""
    if name in FIELDS:
        words, unit = FIELDS[name]
        return f"{words} ({unit})" if unit else words
    stem, number = name[:-1].rstrip("_"), name[-1:]
    kinds = {"u": ("displacement", "m"), "velocity": ("velocity", "m/s")}
    if stem in kinds and number in ("1", "2", "3"):
        kind, unit = kinds[stem]
        return f"{kind} along {'xyz'[int(number) - 1]} ({unit})"
    return name.replace("_", " ")


def column_label(name: str) -> str:
    """Name of a column of the history, such as "work of loads and supports" for external."""
    return COLUMNS.get(name, name.replace("_", " "))


def column_unit(name: str) -> str:
    """Unit of a column that a part reports, such as "N" for ball_force_z; "" for one without a known unit."""
    words = name.split("_")
    known = [word for word in words[-2:] if word in UNITS]
    return UNITS[known[-1]] if known else ""
