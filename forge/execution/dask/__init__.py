"""Packages built on other machines, as tasks of a Dask scheduler; the board stays here."""
