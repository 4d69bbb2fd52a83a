"""Tearing by a damage field: its energy, the way of its tips, cuts that are drawn, materials beyond their strength."""
