"""A node with a life cycle in Python."""
