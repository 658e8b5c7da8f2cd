// The containers in generated messages, with the allocator of the message.

#ifndef ROSIDL_RUNTIME_CPP__MEMBER_TYPES_HPP_
#define ROSIDL_RUNTIME_CPP__MEMBER_TYPES_HPP_

#include "rosidl_runtime_cpp/requires_cpp17.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

// The headers below are included for code that relies on message headers to do so.
#ifdef ROSIDL_RUNTIME_CPP_GENEROUS_INCLUDES
#include <algorithm>
#include <functional>
#include <iomanip>
#include <sstream>
#endif

namespace rosidl_runtime_cpp
{

template<typename Value, std::size_t UpperBound, typename Allocator>
class BoundedVector;

template<typename ContainerAllocator, typename Value>
using Rebound = typename std::allocator_traits<ContainerAllocator>::template rebind_alloc<Value>;

template<typename ContainerAllocator>
using String =
  std::basic_string<char, std::char_traits<char>, Rebound<ContainerAllocator, char>>;

template<typename ContainerAllocator>
using U16String =
  std::basic_string<char16_t, std::char_traits<char16_t>, Rebound<ContainerAllocator, char16_t>>;

template<typename Value, typename ContainerAllocator>
using Sequence = std::vector<Value, Rebound<ContainerAllocator, Value>>;

/// Requires rosidl_runtime_cpp/bounded_vector.hpp.
template<typename Value, std::size_t UpperBound, typename ContainerAllocator>
using BoundedSequence = BoundedVector<Value, UpperBound, Rebound<ContainerAllocator, Value>>;

}  // namespace rosidl_runtime_cpp

#endif  // ROSIDL_RUNTIME_CPP__MEMBER_TYPES_HPP_
