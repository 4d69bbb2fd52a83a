"""Device side of a simulation: arrays (fields), launches (stages), graphs. It knows nothing of mechanics."""
