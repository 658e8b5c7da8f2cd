// The first error of a program that is compiled as C++14 or older.

#ifndef ROSIDL_RUNTIME_CPP__REQUIRES_CPP17_HPP_
#define ROSIDL_RUNTIME_CPP__REQUIRES_CPP17_HPP_

#if __cplusplus < 201703L && !(defined _MSVC_LANG && _MSVC_LANG >= 201703L)
#error "generated messages need C++17: set(CMAKE_CXX_STANDARD 17) in CMakeLists.txt, or -std=c++17"
#endif

#endif  // ROSIDL_RUNTIME_CPP__REQUIRES_CPP17_HPP_
