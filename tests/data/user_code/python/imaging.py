"""Camera images between messages and numpy, with and without copies."""

from array import array

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image


def to_message(picture: NDArray[np.uint8]) -> Image:
    message = Image()
    message.height, message.width = picture.shape[:2]
    message.encoding = "rgb8"
    message.is_bigendian = 0
    message.step = message.width * 3
    message.data = picture.tobytes()
    return message


def to_numpy(message: Image) -> NDArray[np.uint8]:
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)


picture = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
message = to_message(picture)
assert isinstance(message.data, array)
assert message.data.typecode == "B"
assert (message.step, len(message.data)) == (15, 60)
assert np.array_equal(to_numpy(message), picture)

to_numpy(message)[0, 0, 0] = 99
assert message.data[0] == 99, "a view, not a copy"

ready = array("B", bytes(60))
message.data = ready
assert message.data is ready, "what has the right form is stored as it is"

packed = CompressedImage(format="jpeg", data=b"\xff\xd8\xff")
packed.data.extend(b"\xe0")
assert bytes(packed.data) == b"\xff\xd8\xff\xe0"

info = CameraInfo()
info.k = np.array([[525.0, 0, 320], [0, 525, 240], [0, 0, 1]]).flatten()
info.p[:4] = [525.0, 0.0, 320.0, 0.0]
info.d = [0.1, -0.2, 0.0, 0.0, 0.0]
assert info.k.reshape(3, 3)[1, 2] == 240
assert info.k.dtype == np.float64
assert info.p.sum() == 845
assert isinstance(info.d, array)
