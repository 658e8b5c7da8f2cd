"""Laser scans: sequences of floats that are read, filtered and replaced."""

import math
from array import array

import numpy as np
from sensor_msgs.msg import JointState, LaserScan

scan = LaserScan(angle_min=-1.5, angle_max=1.5, angle_increment=0.5, range_min=0.1, range_max=10.0)
scan.ranges = [1.0, 2.0, math.inf, 0.05, 4.0, 3.5, math.nan]
assert isinstance(scan.ranges, array)

valid = [distance for distance in scan.ranges if scan.range_min <= distance <= scan.range_max]
assert valid == [1.0, 2.0, 4.0, 3.5]
assert min(valid) == 1.0

ranges = np.asarray(scan.ranges)
assert ranges.dtype == np.float32
ranges[ranges > 3] = 3.0
assert scan.ranges[4] == 3.0, "numpy sees the message's own memory"
scan.ranges = ranges.tolist()
scan.intensities = array("f", [1.0] * len(scan.ranges))
assert len(scan.intensities) == len(scan.ranges) == 7

state = JointState(name=["left", "right"], position=[0.0, 0.5])
state.velocity.append(0.1)
state.velocity.extend([0.2])
by_name = dict(zip(state.name, state.position, strict=True))
assert by_name["right"] == 0.5
assert state.velocity[1] == 0.2
assert not state.effort
