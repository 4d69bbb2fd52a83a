"""This code beside others: the same problems, error over time."""
