"""Completion of command lines in shells, for `forge completion`."""
