"""Writers of result files: observers that receive frames; the simulation does not depend on them.

Each module imports its own library (`usd`: pxr, `vtkhdf`: h5py), so this package imports none of them.
"""
