"""Warnings about underlays, the interpreter and CMake arguments, and why a package lacks an executable."""
