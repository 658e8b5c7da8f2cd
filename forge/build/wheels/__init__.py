"""Building the wheel of a Python package and installing it into a prefix."""
