"""Running a scene: recorder, energy balance, restart, summary."""
