// Templates that take any message ask its traits.

#include <cassert>
#include <cstring>
#include <string>
#include <type_traits>

#include "example_interfaces/action/fibonacci.hpp"
#include "example_interfaces/srv/add_two_ints.hpp"
#include "geometry_msgs/msg/pose.hpp"
#include "rover/msg/waypoint.hpp"
#include "std_msgs/msg/string.hpp"

namespace asking
{

namespace traits = rosidl_generator_traits;
using example_interfaces::action::Fibonacci;
using example_interfaces::srv::AddTwoInts;

static_assert(traits::is_message<std_msgs::msg::String>::value);
static_assert(traits::is_message<AddTwoInts::Request>::value);
static_assert(!traits::is_message<AddTwoInts>::value && !traits::is_message<int>::value);
static_assert(traits::is_service<AddTwoInts>::value);
static_assert(traits::is_service_request<AddTwoInts::Request>::value);
static_assert(traits::is_service_response<AddTwoInts::Response>::value);
static_assert(traits::is_action<Fibonacci>::value);
static_assert(traits::is_action_goal<Fibonacci::Goal>::value);
static_assert(traits::is_action_result<Fibonacci::Result>::value);
static_assert(traits::is_action_feedback<Fibonacci::Feedback>::value);
static_assert(traits::has_fixed_size<geometry_msgs::msg::Pose>::value);
static_assert(!traits::has_fixed_size<rover::msg::Waypoint>::value);
static_assert(traits::has_bounded_size<rover::msg::Waypoint>::value);
static_assert(!traits::has_bounded_size<std_msgs::msg::String>::value);

template<typename MessageT>
std::enable_if_t<traits::is_message<MessageT>::value, std::string> topic_type(const MessageT &)
{
  return traits::name<MessageT>();
}

template<typename ServiceT, std::enable_if_t<traits::is_service<ServiceT>::value, int> = 0>
const char * service_type()
{
  return traits::data_type<ServiceT>();
}

void run()
{
  assert(topic_type(geometry_msgs::msg::Pose()) == "geometry_msgs/msg/Pose");
  assert(topic_type(AddTwoInts::Request()) == "example_interfaces/srv/AddTwoInts_Request");
  assert(std::strcmp(service_type<AddTwoInts>(), "example_interfaces::srv::AddTwoInts") == 0);
}

}  // namespace asking
