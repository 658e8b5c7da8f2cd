// Hashes of messages, for unordered containers.
//
//   std::unordered_set<geometry_msgs::msg::Point, forge_cdr::Hash> points;
//
// In C++20, std::hash is defined for messages as well. Equal messages have the same hash: 0.0 and -0.0 are equal.

#ifndef FORGE_CDR__HASH_HPP_
#define FORGE_CDR__HASH_HPP_

#include "rosidl_runtime_cpp/requires_cpp17.hpp"

#include <array>
#include <cstddef>
#include <functional>
#include <string_view>
#include <type_traits>

#include "forge_cdr/detail/types.hpp"
#include "forge_cdr/members.hpp"

namespace forge_cdr
{

namespace detail
{

/// Combines the hashes of members.
class Hasher
{
public:
  std::size_t result() const noexcept
  {
    return _result;
  }

  template<typename ... Leaves>
  void fixed(const Leaves & ... leaves)
  {
    (value(leaves), ...);
  }

  template<typename Text>
  void text(const Text & value, std::size_t = unbounded)
  {
    using View = std::basic_string_view<typename Text::value_type>;
    combine(std::hash<View>()(View(value.data(), value.size())));
  }

  template<typename Message>
  void message(const Message & value)
  {
    Members<Message>::visit(*this, value);
  }

  template<typename Values>
  void array(const Values & values, std::size_t = unbounded)
  {
    using Value = typename Values::value_type;
    // The numbers of an image are hashed together. Floating-point numbers can be equal in spite of other bytes.
    if constexpr (std::is_integral_v<Value> && !std::is_same_v<Value, bool>) {
      text(std::string_view(
        reinterpret_cast<const char *>(values.data()), values.size() * sizeof(Value)));
    } else {
      for (const Value & each : values) {
        value(each);
      }
    }
  }

  template<typename Values>
  void sequence(const Values & values, std::size_t = unbounded)
  {
    combine(values.size());
    array(values);
  }

private:
  template<typename Value>
  void value(const Value & value)
  {
    if constexpr (std::is_arithmetic_v<Value>) {
      combine(std::hash<Value>()(value));
    } else if constexpr (IsText<Value>::value) {
      text(value);
    } else {
      message(value);
    }
  }

  template<typename Value, std::size_t Size>
  void value(const std::array<Value, Size> & values)
  {
    array(values);
  }

  void combine(std::size_t hash) noexcept
  {
    _result ^= hash + static_cast<std::size_t>(0x9e3779b97f4a7c15u) + (_result << 6) + (_result >> 2);
  }

  std::size_t _result = 0;
};

}  // namespace detail

/// The hash of any message with a generated header.
struct Hash
{
  template<typename Message>
  std::size_t operator()(const Message & message) const
  {
    detail::Hasher hasher;
    hasher.message(message);
    return hasher.result();
  }
};

}  // namespace forge_cdr

#if defined __cpp_concepts && __cplusplus >= 202002L
template<typename Message>
requires requires {::forge_cdr::Members<Message>::least;}
struct std::hash<Message>: ::forge_cdr::Hash {};
#endif

#endif  // FORGE_CDR__HASH_HPP_
