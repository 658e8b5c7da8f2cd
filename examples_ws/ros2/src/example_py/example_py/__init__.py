"""First nodes in Python."""
