"""The neural force law: the law, files of trained networks, and their training and evaluation in Torch."""
