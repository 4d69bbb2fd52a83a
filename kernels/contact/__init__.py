"""Kernels of warp_pd/contact."""
