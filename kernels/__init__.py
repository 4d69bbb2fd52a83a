"""Device side of warp_pd: Warp functions and kernels, one file per piece of physics.

Cached factories make the kernels; they take the precision and the compile-time options. Each kernel is a separate Warp
module named by a hash of its content, so scenes share compiled kernels. The host declares all kernels of a simulation
before the first launch, because compilation dominates the time of a first run.

Conventions: the unknown is `displacement`, never the position, so float32 resolves small deformations. Bond arrays have
the shape [member, point]. Every kernel takes `first`, the index of its first thread, so two host threads can each run
half of a launch. No kernel uses atomics on floats, so results are reproducible bit for bit on a device.
"""

import warp as wp

wp.config.enable_backward = False
