"""Faster paths to the same force: families that share blocks, undamaged lattices."""
