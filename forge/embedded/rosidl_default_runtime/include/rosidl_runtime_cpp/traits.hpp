// Traits of generated types; generated headers specialize these.

#ifndef ROSIDL_RUNTIME_CPP__TRAITS_HPP_
#define ROSIDL_RUNTIME_CPP__TRAITS_HPP_

#include <type_traits>

#ifdef ROSIDL_RUNTIME_CPP_DEFINITIONS
#include <string_view>
#endif

namespace rosidl_generator_traits
{

/// The C++ name: "pkg::msg::Name".
template<typename T>
constexpr const char * data_type();

/// The ROS name: "pkg/msg/Name".
template<typename T>
constexpr const char * name();

#ifdef ROSIDL_RUNTIME_CPP_DEFINITIONS
/// The text of the .msg, .srv, .action or .idl file in which the type is defined; not in rosidl.
template<typename T>
constexpr std::string_view definition();

/// The unit of a field whose comment has one, as in 'speed [m/s]', otherwise empty; not in rosidl.
template<typename T>
constexpr std::string_view unit(std::string_view)
{
  return {};
}
#endif

/// True if the type contains no string or sequence, at any depth.
template<typename T>
struct has_fixed_size : std::false_type {};

/// True if the type contains no unbounded string or sequence, at any depth.
template<typename T>
struct has_bounded_size : std::false_type {};

template<typename T>
struct is_message : std::false_type {};

template<typename T>
struct is_service : std::false_type {};

template<typename T>
struct is_service_request : std::false_type {};

template<typename T>
struct is_service_response : std::false_type {};

template<typename T>
struct is_action : std::false_type {};

template<typename T>
struct is_action_goal : std::false_type {};

template<typename T>
struct is_action_result : std::false_type {};

template<typename T>
struct is_action_feedback : std::false_type {};

}  // namespace rosidl_generator_traits

#endif  // ROSIDL_RUNTIME_CPP__TRAITS_HPP_
