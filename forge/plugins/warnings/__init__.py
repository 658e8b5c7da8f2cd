"""Warnings in the output of packages: those that compilers print below ninja, and repeated ones once."""
