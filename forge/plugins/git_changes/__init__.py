"""Packages that differ from a git revision, for `--packages-select-changed` and related options."""
