"""A service that adds two numbers, and its client, in Python."""
