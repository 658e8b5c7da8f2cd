"""Inputs of a build: sources, headers, programs and variables, as comparable stats and digests."""

__all__ = ["elf", "fingerprints", "native_graph"]
