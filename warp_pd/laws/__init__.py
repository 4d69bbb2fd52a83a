"""The bond-associated force law, which maps displacements to forces. interfaces/law.py defines what a law is."""
