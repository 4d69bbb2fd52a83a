"""Error against run time: studies.py says what is compared with what, sweep.py runs it, tables.py shows it."""
