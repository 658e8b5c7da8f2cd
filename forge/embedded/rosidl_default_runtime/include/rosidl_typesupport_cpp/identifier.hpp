#ifndef ROSIDL_TYPESUPPORT_CPP__IDENTIFIER_HPP_
#define ROSIDL_TYPESUPPORT_CPP__IDENTIFIER_HPP_

namespace rosidl_typesupport_cpp
{

/// The identifier of handles in generated C++. Their data is the name of the type, "pkg/msg/Name".
inline constexpr const char * typesupport_identifier = "forge_typesupport_cpp";

}  // namespace rosidl_typesupport_cpp

#endif  // ROSIDL_TYPESUPPORT_CPP__IDENTIFIER_HPP_
