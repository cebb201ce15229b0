"""Runs on one self-contained HTML page: verdict, checks, pictures, curves, contacts, solver times, and how to
repeat them.

find.py collects the files, run.py reads one run, page.py fills the templates beside it; plots.py, lanes.py,
pictures.py and solver_times.py prepare what the templates only place.
"""
