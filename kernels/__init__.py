"""Device side of warp_pd: Warp functions and kernels, one file a piece of physics.

Every file offers one cached factory. A factory takes the numeric types (and the choices that are
compiled in) and the name of the module that its kernels belong to; the host declares all kernels of a
configuration in one module before the first launch, because compilation, not run time, decides how long
a first run takes.

Conventions: `displacement` is the unknown, never the position, so that float32 keeps the digits of small
deformations. Arrays of bonds are [member, point]. Every kernel takes `first`, the index of its first
thread: two threads of the host can run two halves of one launch. Nothing here adds floats atomically:
results repeat bit for bit on a device.
"""

import warp as wp

wp.config.enable_backward = False
