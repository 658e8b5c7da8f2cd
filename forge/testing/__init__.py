"""Runs the tests of packages and reads their results.

Start reading at `preparing` (the plan of a run; forge.build.tests has the steps), `outcomes` (result files to
counts and cases) and `failures` (their output).
"""

__all__ = ["outcomes"]
