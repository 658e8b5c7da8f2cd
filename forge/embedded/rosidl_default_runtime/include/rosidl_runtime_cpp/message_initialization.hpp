#ifndef ROSIDL_RUNTIME_CPP__MESSAGE_INITIALIZATION_HPP_
#define ROSIDL_RUNTIME_CPP__MESSAGE_INITIALIZATION_HPP_

namespace rosidl_runtime_cpp
{

/// What the constructor of a message does to its members.
enum class MessageInitialization
{
  /// Give defaults to the members that have one, zero to the others.
  ALL = 0,
  /// Leave every member as it happens to be.
  SKIP = 1,
  /// Give zero to every member, defaults or not.
  ZERO = 2,
  /// Give defaults to the members that have one, leave the others as they happen to be.
  DEFAULTS_ONLY = 3
};

}  // namespace rosidl_runtime_cpp

#endif  // ROSIDL_RUNTIME_CPP__MESSAGE_INITIALIZATION_HPP_
