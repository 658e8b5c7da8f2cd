// What templates can ask about the types of generated headers, which specialise these.

#ifndef ROSIDL_RUNTIME_CPP__TRAITS_HPP_
#define ROSIDL_RUNTIME_CPP__TRAITS_HPP_

#include <type_traits>

namespace rosidl_generator_traits
{

/// The name as C++ writes it: "pkg::msg::Name".
template<typename T>
constexpr const char * data_type();

/// The name as ROS writes it: "pkg/msg/Name".
template<typename T>
constexpr const char * name();

/// Neither a string nor a sequence inside, however deep.
template<typename T>
struct has_fixed_size : std::false_type {};

/// No string or sequence without a bound inside, however deep.
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
