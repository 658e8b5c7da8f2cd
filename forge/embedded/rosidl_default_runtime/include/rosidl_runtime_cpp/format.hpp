// Messages as text in streams, in std::format and, if included before, in fmt: that of to_yaml on one line.
//
//   using rosidl_runtime_cpp::operator<<;
//   std::cout << message;
//   std::format("{:>40}", message);

#ifndef ROSIDL_RUNTIME_CPP__FORMAT_HPP_
#define ROSIDL_RUNTIME_CPP__FORMAT_HPP_

#include "rosidl_runtime_cpp/requires_cpp17.hpp"

#include <ostream>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#if __cplusplus >= 202002L
#include <version>
#endif
#ifdef __cpp_lib_format
#include <format>
#endif

#include "rosidl_runtime_cpp/yaml.hpp"

namespace rosidl_runtime_cpp
{

template<typename Message>
auto operator<<(std::ostream & out, const Message & message)
-> decltype(write_yaml(std::declval<YamlWriter &>(), message), out)
{
  to_flow_style_yaml(message, out);
  return out;
}

}  // namespace rosidl_runtime_cpp

#ifdef __cpp_lib_format
template<typename Message>
requires requires(::rosidl_runtime_cpp::YamlWriter & out, const Message & message) {write_yaml(out, message);}
struct std::formatter<Message, char>: std::formatter<std::string_view, char>
{
  template<typename Context>
  auto format(const Message & message, Context & context) const
  {
    const std::string text = ::rosidl_runtime_cpp::to_yaml(message, true);
    return std::formatter<std::string_view, char>::format(text, context);
  }
};
#endif

#ifdef FMT_VERSION
template<typename Message>
struct fmt::formatter<
  Message, char,
  std::void_t<decltype(write_yaml(
    std::declval<::rosidl_runtime_cpp::YamlWriter &>(), std::declval<const Message &>()))>>
  : fmt::formatter<fmt::string_view>
{
  template<typename Context>
  auto format(const Message & message, Context & context) const
  {
    const std::string text = ::rosidl_runtime_cpp::to_yaml(message, true);
    return fmt::formatter<fmt::string_view>::format(text, context);
  }
};
#endif

#endif  // ROSIDL_RUNTIME_CPP__FORMAT_HPP_
