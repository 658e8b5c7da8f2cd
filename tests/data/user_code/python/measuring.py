"""Fixed arrays are numpy's: covariances are filled, sliced, reshaped and compared."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovariance
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

imu = Imu()
assert imu.orientation_covariance.shape == (9,)
imu.orientation_covariance[0] = -1.0
imu.angular_velocity_covariance = [0.1 if i % 4 == 0 else 0.0 for i in range(9)]
imu.linear_acceleration_covariance = np.eye(3).ravel()
assert np.trace(imu.linear_acceleration_covariance.reshape(3, 3)) == 3
assert imu.angular_velocity_covariance[8] == 0.1
assert Imu().orientation_covariance[0] == 0.0, "messages share nothing"

odometry = Odometry()
odometry.pose.covariance[::7] = 0.01
assert np.allclose(np.diag(odometry.pose.covariance.reshape(6, 6)), 0.01)

given = tuple(float(number) for number in range(36))
assert PoseWithCovariance(covariance=given).covariance.tolist() == list(given)

one, other = Imu(), Imu()
assert one == other
other.orientation_covariance[8] = 1.0
assert one != other, "one different element is enough"

with pytest.raises(AssertionError, match="size of 9"):
    imu.orientation_covariance = np.zeros(8)
with pytest.raises(AssertionError, match="dtype"):
    imu.orientation_covariance = np.zeros(9, np.complex64)
