"""The memory of packages: measured while they are built, so that the next one starts only if it fits."""
