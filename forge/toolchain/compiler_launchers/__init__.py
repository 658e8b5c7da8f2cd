"""Compiler launchers: programs that cache compilations or distribute them to other machines."""

__all__ = ["launcher_stats"]
