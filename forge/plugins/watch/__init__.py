"""Builds that follow changes of source files, for `forge build --watch`."""
