"""The instrument: replays the paper's tables on real rooms, and writes each as a table and a plot.

`python3 -m nox -s evaluate` runs it; `__main__` has the command line.
"""
