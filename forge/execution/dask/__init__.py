"""Build packages on the workers of a Dask cluster; this process keeps scheduling them."""
