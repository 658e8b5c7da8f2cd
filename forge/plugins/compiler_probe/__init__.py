"""Detects compilers once for all packages of a workspace, unless `forge build --no-toolchain-cache`."""
