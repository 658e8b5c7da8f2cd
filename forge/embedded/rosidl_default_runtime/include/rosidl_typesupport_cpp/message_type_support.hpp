#ifndef ROSIDL_TYPESUPPORT_CPP__MESSAGE_TYPE_SUPPORT_HPP_
#define ROSIDL_TYPESUPPORT_CPP__MESSAGE_TYPE_SUPPORT_HPP_

#include "rosidl_runtime_c/message_type_support_struct.h"
#include "rosidl_runtime_cpp/traits.hpp"
#include "rosidl_typesupport_cpp/identifier.hpp"

namespace rosidl_typesupport_cpp
{

/// The type support of a message whose generated header is included; its data is the message's name.
template<typename T>
const rosidl_message_type_support_t * get_message_type_support_handle()
{
  static constexpr rosidl_message_type_support_t handle{
    typesupport_identifier, ::rosidl_generator_traits::name<T>(), get_message_typesupport_handle_function};
  return &handle;
}

}  // namespace rosidl_typesupport_cpp

/// Generated headers define by this the same as a function for C. Where it is missing, the run time is not
/// forge's and brings libraries with those functions.
#define FORGE_CPP_MESSAGE_TYPE_SUPPORT(package, kind, name) \
  inline const rosidl_message_type_support_t * \
  rosidl_typesupport_cpp__get_message_type_support_handle__ ## package ## __ ## kind ## __ ## name() \
  { \
    return ::rosidl_typesupport_cpp::get_message_type_support_handle<::package::kind::name>(); \
  }

#endif  // ROSIDL_TYPESUPPORT_CPP__MESSAGE_TYPE_SUPPORT_HPP_
