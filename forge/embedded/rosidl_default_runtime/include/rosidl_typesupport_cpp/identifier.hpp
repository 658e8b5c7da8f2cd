#ifndef ROSIDL_TYPESUPPORT_CPP__IDENTIFIER_HPP_
#define ROSIDL_TYPESUPPORT_CPP__IDENTIFIER_HPP_

namespace rosidl_typesupport_cpp
{

/// What handles of generated C++ are called here. They hold the type's name, "pkg/msg/Name", and no code.
inline constexpr const char * typesupport_identifier = "forge_typesupport_cpp";

}  // namespace rosidl_typesupport_cpp

#endif  // ROSIDL_TYPESUPPORT_CPP__IDENTIFIER_HPP_
