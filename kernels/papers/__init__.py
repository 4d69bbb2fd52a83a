"""Kernels of warp_pd/papers."""
