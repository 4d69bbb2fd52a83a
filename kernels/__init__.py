"""Device side of warp_pd: Warp functions and kernels, one file per piece of physics.

Kernels are made by cached factories. A factory takes the numeric types (and the options that are
compiled in) and the name of the module that its kernels belong to. The host declares all kernels of a
configuration in one module before the first launch, because compilation, not run time, decides how long
a first run takes.

Conventions: `displacement` is the unknown, never the position, so that float32 keeps the digits of small
deformations. Arrays of bonds are [member, point]. Every kernel takes `first`, the index of its first
thread, so that two host threads can each run half of a launch. No kernel adds floats atomically:
results repeat bit for bit on a device.
"""

import warp as wp

wp.config.enable_backward = False
