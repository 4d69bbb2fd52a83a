"""What a simulation keeps on its device: arrays (fields), launches (stages), graphs. It knows nothing of mechanics."""
