#ifndef ROSIDL_TYPESUPPORT_CPP__SERVICE_TYPE_SUPPORT_HPP_
#define ROSIDL_TYPESUPPORT_CPP__SERVICE_TYPE_SUPPORT_HPP_

#include "rosidl_runtime_c/service_type_support_struct.h"
#include "rosidl_runtime_cpp/traits.hpp"
#include "rosidl_typesupport_cpp/identifier.hpp"

namespace rosidl_typesupport_cpp
{

/// Returns the type support of a service; requires its generated header. Its data is the name of the service.
template<typename T>
const rosidl_service_type_support_t * get_service_type_support_handle()
{
  static constexpr rosidl_service_type_support_t handle{
    typesupport_identifier, ::rosidl_generator_traits::name<T>(), get_service_typesupport_handle_function};
  return &handle;
}

}  // namespace rosidl_typesupport_cpp

/// Defines the same function for C; used in generated headers. It is not defined by other run times, which
/// provide libraries with these functions.
#define FORGE_CPP_SERVICE_TYPE_SUPPORT(package, kind, name) \
  inline const rosidl_service_type_support_t * \
  rosidl_typesupport_cpp__get_service_type_support_handle__ ## package ## __ ## kind ## __ ## name() \
  { \
    return ::rosidl_typesupport_cpp::get_service_type_support_handle<::package::kind::name>(); \
  }

#endif  // ROSIDL_TYPESUPPORT_CPP__SERVICE_TYPE_SUPPORT_HPP_
