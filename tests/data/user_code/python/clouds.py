"""Point clouds: fields say where in a point a number is; numpy reads all points at once."""

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

DTYPES = {
    PointField.INT8: "i1",
    PointField.UINT8: "u1",
    PointField.INT16: "i2",
    PointField.UINT16: "u2",
    PointField.INT32: "i4",
    PointField.UINT32: "u4",
    PointField.FLOAT32: "f4",
    PointField.FLOAT64: "f8",
}


def layout(cloud: PointCloud2) -> "np.dtype[np.void]":
    order = ">" if cloud.is_bigendian else "<"
    return np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [order + DTYPES[field.datatype] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )


fields = [
    PointField(name=name, offset=4 * place, datatype=PointField.FLOAT32, count=1)
    for place, name in enumerate("xyz")
]
fields.append(PointField(name="ring", offset=14, datatype=PointField.UINT16, count=1))
cloud = PointCloud2(
    header=Header(frame_id="lidar"),
    height=1,
    width=10,
    fields=fields,
    point_step=16,
    row_step=160,
    is_dense=True,
)
points = np.zeros(10, layout(cloud))
points["x"] = np.linspace(0, 1, 10)
points["ring"] = np.arange(10)
cloud.data = points.tobytes()

read = np.frombuffer(cloud.data, layout(cloud))
assert np.allclose(read["x"], points["x"])
assert read["ring"].tolist() == list(range(10))
assert len(cloud.data) == cloud.row_step * cloud.height
