"""Kernels of warp_pd/implicit."""
