"""Stability of the force laws on stiff and extreme cases: a verdict and a number for each case and law.

verdicts.py says what a verdict is, laws.py makes the laws, runs.py runs them; cases/ has the cases. execution.py
fills the cells, results.py keeps them, tables.py and page.py make the page, and cli.py has the options.
"""
