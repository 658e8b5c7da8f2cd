#ifndef ROSIDL_RUNTIME_CPP__MESSAGE_INITIALIZATION_HPP_
#define ROSIDL_RUNTIME_CPP__MESSAGE_INITIALIZATION_HPP_

namespace rosidl_runtime_cpp
{

/// How the constructor of a message initializes its members.
enum class MessageInitialization
{
  /// Set members to their defaults, others to zero.
  ALL = 0,
  /// Leave all members uninitialized.
  SKIP = 1,
  /// Set all members to zero and ignore defaults.
  ZERO = 2,
  /// Set members to their defaults, and leave others uninitialized.
  DEFAULTS_ONLY = 3
};

}  // namespace rosidl_runtime_cpp

#endif  // ROSIDL_RUNTIME_CPP__MESSAGE_INITIALIZATION_HPP_
