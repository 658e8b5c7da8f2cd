#ifndef FORGE_CDR__DETAIL__SIZER_HPP_
#define FORGE_CDR__DETAIL__SIZER_HPP_

#include <array>
#include <cstddef>
#include <type_traits>

#include "forge_cdr/detail/types.hpp"

namespace forge_cdr::detail
{

/// Computes the number of bytes that a Writer writes.
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
  FORGE_CDR_INLINE void text(const Text & value)
  {
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
  FORGE_CDR_INLINE void array(const std::array<Value, Size> & values)
  {
    items<Value>(values);
  }

  template<typename Sequence>
  FORGE_CDR_INLINE void sequence(const Sequence & values)
  {
    add(4, 4);
    if (!values.empty()) {
      items<typename Sequence::value_type>(values);
    }
  }

private:
  FORGE_CDR_INLINE void add(std::size_t alignment, std::size_t size)
  {
    _offset = aligned(_offset, alignment) + size;
  }

  template<typename Value, typename Range>
  FORGE_CDR_INLINE void items(const Range & values)
  {
    if constexpr (std::is_arithmetic_v<Value>) {
      add(Leaf<Value>::alignment, values.size() * Leaf<Value>::size);
    } else if constexpr (is_packed<Value>()) {
      add(Leaf<Value>::alignment, values.size() * sizeof(Value));
    } else {
      for (const Value & value : values) {
        if constexpr (IsText<Value>::value) {
          text(value);
        } else {
          message(value);
        }
      }
    }
  }

  std::size_t _offset = 0;
};

}  // namespace forge_cdr::detail

#endif  // FORGE_CDR__DETAIL__SIZER_HPP_
