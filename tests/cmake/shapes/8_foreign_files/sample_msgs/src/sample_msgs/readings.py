"""Readings to try things with."""

from sample_msgs.msg import Reading


def sample_reading():
    """Return a reading."""
    reading = Reading()
    reading.limits.high = 4.5
    return reading
