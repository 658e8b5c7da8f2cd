// Strings of both widths, octets and time.

#include <cassert>
#include <chrono>
#include <string>

#include "builtin_interfaces/msg/time.hpp"
#include "example_interfaces/msg/w_string.hpp"
#include "rcl_interfaces/msg/log.hpp"
#include "std_msgs/msg/byte_multi_array.hpp"
#include "std_msgs/msg/multi_array_dimension.hpp"

namespace writing
{

builtin_interfaces::msg::Time stamp(std::chrono::nanoseconds since)
{
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since);
  builtin_interfaces::msg::Time time;
  time.sec = static_cast<int32_t>(seconds.count());
  time.nanosec = static_cast<uint32_t>((since - seconds).count());
  return time;
}

void run()
{
  example_interfaces::msg::WString wide;
  wide.data = u"h\u00e9";
  wide.data += u'!';
  assert(wide.data.size() == 3 && wide.data[1] == 0xe9);

  std_msgs::msg::ByteMultiArray bytes;
  bytes.data = {0x00, 0xff};
  bytes.layout.dim.resize(1);
  bytes.layout.dim[0].set__label("x").set__size(2).set__stride(2);
  assert(bytes.data[1] == 255 && bytes.layout.dim[0].label == "x");

  rcl_interfaces::msg::Log log;
  log.level = rcl_interfaces::msg::Log::WARN;
  log.stamp = stamp(std::chrono::milliseconds(1500));
  log.msg = std::string("took ") + std::to_string(log.stamp.sec) + " s";
  assert(log.stamp.nanosec == 500000000u && log.msg == "took 1 s" && log.level == 30);
}

}  // namespace writing
