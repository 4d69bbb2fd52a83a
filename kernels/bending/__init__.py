"""Kernels of warp_pd/bending."""
