"""Kernels of warp_pd/tearing."""
