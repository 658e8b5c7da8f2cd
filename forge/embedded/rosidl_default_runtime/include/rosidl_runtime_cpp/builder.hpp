// pkg::build<pkg::msg::Name>().first(value).second(value) and so on, in the order of declaration.

#ifndef ROSIDL_RUNTIME_CPP__BUILDER_HPP_
#define ROSIDL_RUNTIME_CPP__BUILDER_HPP_

namespace rosidl_runtime_cpp
{

/// Specialized by generated headers: FirstStep is the first step of build().
template<typename Message>
struct Builder;

/// Start to build a message; setting the last member returns it.
template<typename Message>
typename Builder<Message>::FirstStep build()
{
  return typename Builder<Message>::FirstStep();
}

}  // namespace rosidl_runtime_cpp

#endif  // ROSIDL_RUNTIME_CPP__BUILDER_HPP_
