"""One module a code: `solve(problem, settings)` gives places, displacement and what is to be told."""
