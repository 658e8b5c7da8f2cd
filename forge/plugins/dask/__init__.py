"""Builds packages on the workers of a Dask cluster: `forge build --executor dask`."""
