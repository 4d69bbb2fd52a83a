"""The neural force law: the law, the files of trained networks, and Torch, which evaluates them."""
