"""The only folder that imports torch: the network as a step of a simulation, and its training."""
