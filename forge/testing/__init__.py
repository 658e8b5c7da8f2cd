"""Runs the tests of packages and reads their results.

Start reading at `preparing` (the plan of a run; forge.build.tests defines the steps) and `outcomes` (result
files to counts and cases).
"""

__all__ = ["collecting", "outcomes"]
