"""Static equilibrium: Newton's method with its linear solvers, relaxation, and paths that turn."""
