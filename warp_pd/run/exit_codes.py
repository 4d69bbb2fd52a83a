"""Exit codes of the command line."""

WRONG_INPUT, DIVERGED, LOST, INTERRUPTED = 2, 3, 4, 130
