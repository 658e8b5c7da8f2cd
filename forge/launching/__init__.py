"""Compiler launchers: programs before the compiler, which take its work from a cache or to other machines."""
