"""Bending stiffness beside a force law."""
