"""Solvers, which compute displacements from forces; interfaces/solver.py defines their interface."""
