"""Kernels of warp_pd/statics."""
