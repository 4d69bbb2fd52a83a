"""Kernels of warp_pd/fast."""
