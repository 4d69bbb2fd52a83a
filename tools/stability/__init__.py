"""Stability of the force laws on stiff and extreme cases: a verdict and a number for each case and law.

verdicts.py says what a verdict is, laws.py makes the laws, motion.py and runs.py move and run them; cases/ has the
cases, and tables.py the tables of the page.
"""
