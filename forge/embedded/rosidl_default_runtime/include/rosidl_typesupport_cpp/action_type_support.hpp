#ifndef ROSIDL_TYPESUPPORT_CPP__ACTION_TYPE_SUPPORT_HPP_
#define ROSIDL_TYPESUPPORT_CPP__ACTION_TYPE_SUPPORT_HPP_

#include "rosidl_runtime_c/action_type_support_struct.h"
#include "rosidl_typesupport_cpp/message_type_support.hpp"
#include "rosidl_typesupport_cpp/service_type_support.hpp"

namespace rosidl_typesupport_cpp
{

/// Returns the type support of an action; requires its generated header.
template<typename T>
const rosidl_action_type_support_t * get_action_type_support_handle()
{
  using Impl = typename T::Impl;
  static const rosidl_action_type_support_t handle{
    get_service_type_support_handle<typename Impl::SendGoalService>(),
    get_service_type_support_handle<typename Impl::GetResultService>(),
    get_service_type_support_handle<typename Impl::CancelGoalService>(),
    get_message_type_support_handle<typename Impl::FeedbackMessage>(),
    get_message_type_support_handle<typename Impl::GoalStatusMessage>()};
  return &handle;
}

}  // namespace rosidl_typesupport_cpp

/// Defines the same function for C; used in generated headers.
#define FORGE_CPP_ACTION_TYPE_SUPPORT(package, kind, name) \
  inline const rosidl_action_type_support_t * \
  rosidl_typesupport_cpp__get_action_type_support_handle__ ## package ## __ ## kind ## __ ## name() \
  { \
    return ::rosidl_typesupport_cpp::get_action_type_support_handle<::package::kind::name>(); \
  }

#endif  // ROSIDL_TYPESUPPORT_CPP__ACTION_TYPE_SUPPORT_HPP_
