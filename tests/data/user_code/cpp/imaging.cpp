// Images and point clouds: bytes in vectors, read and written as what they stand for.

#include <cassert>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <vector>

#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace imaging
{

sensor_msgs::msg::Image::UniquePtr picture(uint32_t width, uint32_t height)
{
  auto image = std::make_unique<sensor_msgs::msg::Image>();
  image->header.frame_id = "camera";
  image->width = width;
  image->height = height;
  image->encoding = "mono8";
  image->is_bigendian = false;
  image->step = width;
  image->data.resize(image->step * image->height);
  std::iota(image->data.begin(), image->data.end(), static_cast<uint8_t>(0));
  return image;
}

template<typename T>
T read(const sensor_msgs::msg::PointCloud2 & cloud, std::size_t point, std::size_t field)
{
  T value;
  std::memcpy(&value, &cloud.data[point * cloud.point_step + cloud.fields[field].offset], sizeof(T));
  return value;
}

void run()
{
  const sensor_msgs::msg::Image::ConstSharedPtr image = picture(4, 3);
  assert(image->data.size() == 12 && image->data.back() == 11);
  const std::vector<uint8_t> row(image->data.begin() + 4, image->data.begin() + 8);
  assert(row.front() == 4);

  sensor_msgs::msg::PointCloud2 cloud;
  for (const char * name : {"x", "y", "z"}) {
    auto & field = cloud.fields.emplace_back();
    field.name = name;
    field.offset = static_cast<uint32_t>(4 * (cloud.fields.size() - 1));
    field.datatype = sensor_msgs::msg::PointField::FLOAT32;
    field.count = 1;
  }
  const float points[2][3] = {{1.0f, 2.0f, 3.0f}, {4.0f, 5.0f, 6.0f}};
  cloud.point_step = sizeof(points[0]);
  cloud.data.resize(sizeof(points));
  std::memcpy(cloud.data.data(), points, sizeof(points));
  assert(read<float>(cloud, 1, 2) == 6.0f);

  sensor_msgs::msg::CameraInfo info;
  info.k = {525.0, 0.0, 320.0, 0.0, 525.0, 240.0, 0.0, 0.0, 1.0};
  info.d.assign(5, 0.0);
  info.p.fill(0.0);
  assert(info.k.at(4) == 525.0 && info.k.size() == 9 && info.p.back() == 0.0);
}

}  // namespace imaging
