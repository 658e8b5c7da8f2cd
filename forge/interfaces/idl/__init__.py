"""OMG IDL 4.2: parse .idl files, and write interfaces as IDL."""

__all__ = ["parsing", "target"]
