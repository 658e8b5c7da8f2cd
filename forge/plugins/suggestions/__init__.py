"""Suggestions for mistyped commands, options and values, and for words of other build tools."""
