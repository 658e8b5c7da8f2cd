"""A node in Python whose log level is a parameter."""
