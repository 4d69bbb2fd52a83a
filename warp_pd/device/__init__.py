"""Device side of a simulation, independent of mechanics: arrays (fields), launches (stages), graphs."""
