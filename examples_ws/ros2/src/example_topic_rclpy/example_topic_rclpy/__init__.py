"""A publisher and a subscriber in Python."""
