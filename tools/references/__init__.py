"""Converged solutions that tests compare with: finite elements of a stretched sheet, and an inflated disc.

membrane_fe.py and shooting.py solve, run.py writes the numbers to tests/references/.
"""
