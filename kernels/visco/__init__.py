"""Kernels of warp_pd/visco."""
