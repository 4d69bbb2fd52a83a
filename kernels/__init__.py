"""Device side of warp_pd: Warp functions and kernels, one file per piece of physics.

Kernels are made by cached factories, which take the precision and the options that are compiled in. Each
kernel is a Warp module of its own, named by its content, so that scenes share compiled kernels. The host
declares all kernels of a simulation before the first launch, because compilation, not run time, decides
how long a first run takes.

Conventions: `displacement` is the unknown, never the position, so that float32 keeps the digits of small
deformations. Arrays of bonds are [member, point]. Every kernel takes `first`, the index of its first
thread, so that two host threads can each run half of a launch. No kernel adds floats atomically:
results repeat bit for bit on a device.
"""

import warp as wp

wp.config.enable_backward = False
