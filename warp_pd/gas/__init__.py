"""Gas and volumes that a sheet encloses."""
