"""What a build reads: sources, headers, programs and variables, as stats and digests that can be compared."""

__all__ = ["depfiles", "fingerprints", "native_graph"]
