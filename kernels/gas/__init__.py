"""Kernels of warp_pd/gas."""
