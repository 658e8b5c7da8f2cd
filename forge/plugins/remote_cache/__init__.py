"""Remote caches: packages that were built on other machines, at any URL of HTTP or fsspec."""
