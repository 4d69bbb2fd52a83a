"""Published examples, one file each: `warp-pd run NAME` calls `build` of the file of that name.

The arguments of `build` are the scene's own numbers: `--points`, `--horizon`, `--weights`, `--duration` and
`--frames` set those of that name, `--set name=value` any of them.
"""
