"""Error against run time of all force laws, horizons, spacings, precisions and solvers, against finite elements.

studies.py lists the scenes, references.py compares with finite elements, sweep.py runs the cases, results.py keeps the
numbers, tables.py and page.py make the page, and cli.py has the options.
"""
