"""`python -m warp_pd` is `warp-pd`."""

from .cli import main

main()
