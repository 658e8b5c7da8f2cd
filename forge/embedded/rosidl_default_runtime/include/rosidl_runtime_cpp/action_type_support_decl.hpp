#ifndef ROSIDL_RUNTIME_CPP__ACTION_TYPE_SUPPORT_DECL_HPP_
#define ROSIDL_RUNTIME_CPP__ACTION_TYPE_SUPPORT_DECL_HPP_

#include "rosidl_runtime_c/action_type_support_struct.h"

namespace rosidl_runtime_cpp
{

/// Specialized by type support libraries for actions.
template<typename T>
const rosidl_action_type_support_t * get_action_type_support_handle();

}  // namespace rosidl_runtime_cpp

#endif  // ROSIDL_RUNTIME_CPP__ACTION_TYPE_SUPPORT_DECL_HPP_
