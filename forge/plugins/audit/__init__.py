"""Undeclared inputs of packages, for `forge build --audit`."""
