"""Implicit time steps."""
