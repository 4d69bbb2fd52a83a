"""Published examples, one file each: `warp-pd run NAME` calls `build` of the file of that name.

The arguments of `build` are the parameters of the scene: `--points`, `--horizon`, `--weights`, `--duration` and
`--frames` set those of the same name, `--set name=value` sets any of them.
"""
