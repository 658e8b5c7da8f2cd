#include "frame_msgs/frames.hpp"

int main()
{
  clock_types::msg::Stamp stamp;
  return frame_msgs::seconds(stamp) == 0.0 ? 0 : 1;
}
