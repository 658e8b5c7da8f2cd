"""Selects packages by the results of the last build and test run."""
