"""Viscoelastic rubber: Prony series and Maxwell branches."""
