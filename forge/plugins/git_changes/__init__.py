"""Packages that differ from a git revision, for `--packages-select-changed` and the options beside it."""
