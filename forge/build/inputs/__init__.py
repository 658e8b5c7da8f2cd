"""Inputs of a build: sources, headers, programs and variables, as comparable stats and digests."""

__all__ = ["depfiles", "fingerprints", "native_graph"]
