"""Converged solutions that tests compare with: stretched and lifted sheets, and inflated and indented discs."""
