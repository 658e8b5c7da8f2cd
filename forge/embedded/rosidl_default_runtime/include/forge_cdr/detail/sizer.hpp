#ifndef FORGE_CDR__DETAIL__SIZER_HPP_
#define FORGE_CDR__DETAIL__SIZER_HPP_

#include <array>
#include <cstddef>
#include <string>
#include <type_traits>

#include "forge_cdr/detail/types.hpp"
#include "forge_cdr/error.hpp"

namespace forge_cdr::detail
{

/// Computes the number of bytes that a Writer writes, and checks the bounds of strings.
class Sizer
{
public:
  /// The size so far; alignment is relative to the first byte.
  std::size_t offset() const noexcept
  {
    return _offset;
  }

  template<typename ... Leaves>
  FORGE_CDR_INLINE void fixed(const Leaves & ...)
  {
    add(Run<Leaves...>::alignment, Run<Leaves...>::size);
  }

  template<typename Text>
  FORGE_CDR_INLINE void text(const Text & value, std::size_t bound = unbounded)
  {
    if (value.size() > bound) {
      check_length(characters(value.data(), value.size()), bound);
    }
    if constexpr (std::is_same_v<typename Text::value_type, char>) {
      add(4, 4 + value.size() + 1);
    } else {
      add(4, 4 + 4 * value.size());
    }
  }

  template<typename Message>
  FORGE_CDR_INLINE void message(const Message & value)
  {
    Members<Message>::visit(*this, value);
  }

  template<typename Value, std::size_t Size>
  FORGE_CDR_INLINE void array(const std::array<Value, Size> & values, std::size_t bound = unbounded)
  {
    items<Value>(values, bound);
  }

  template<typename Sequence>
  FORGE_CDR_INLINE void sequence(const Sequence & values, std::size_t bound = unbounded)
  {
    add(4, 4);
    if (!values.empty()) {
      items<typename Sequence::value_type>(values, bound);
    }
  }

private:
  FORGE_CDR_INLINE void add(std::size_t alignment, std::size_t size)
  {
    _offset = aligned(_offset, alignment) + size;
  }

  template<typename Value, typename Range>
  FORGE_CDR_INLINE void items(const Range & values, [[maybe_unused]] std::size_t bound)
  {
    if constexpr (std::is_arithmetic_v<Value>) {
      add(Leaf<Value>::alignment, values.size() * Leaf<Value>::size);
    } else if constexpr (is_packed<Value>()) {
      add(Leaf<Value>::alignment, values.size() * sizeof(Value));
    } else {
      for (const Value & value : values) {
        if constexpr (IsText<Value>::value) {
          text(value, bound);
        } else {
          message(value);
        }
      }
    }
  }

  FORGE_CDR_COLD static void check_length(std::size_t length, std::size_t bound)
  {
    if (length > bound) {
      throw Error(
        "a string of " + std::to_string(length) + " characters, " + std::to_string(bound) + " are allowed");
    }
  }

  std::size_t _offset = 0;
};

}  // namespace forge_cdr::detail

#endif  // FORGE_CDR__DETAIL__SIZER_HPP_
