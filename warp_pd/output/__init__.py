"""Writers of result files: observers that are handed frames and that the simulation does not know.

Each module imports its own library (`usd`: pxr, `vtkhdf`: h5py), so this package imports none of them.
"""
