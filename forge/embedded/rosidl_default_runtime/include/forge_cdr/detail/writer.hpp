#ifndef FORGE_CDR__DETAIL__WRITER_HPP_
#define FORGE_CDR__DETAIL__WRITER_HPP_

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "forge_cdr/detail/types.hpp"

namespace forge_cdr::detail
{

/// Writes members to a buffer of the size computed by a Sizer, which has checked the bounds; little-endian, with
/// zero padding.
class Writer
{
public:
  /// `body` is the position of the first byte after the header; alignment is relative to it.
  explicit Writer(std::uint8_t * body) noexcept
  : _body(body)
  {
  }

  template<typename ... Leaves>
  FORGE_CDR_INLINE void fixed(const Leaves & ... leaves)
  {
    std::uint8_t * const run = room<Run<Leaves...>::alignment>(Run<Leaves...>::size);
    std::size_t offset = 0;
    (put(run, offset, leaves), ...);
  }

  template<typename Text>
  FORGE_CDR_INLINE void text(const Text & value, std::size_t = unbounded)
  {
    const std::size_t length = value.size();
    if constexpr (std::is_same_v<typename Text::value_type, char>) {
      std::uint8_t * const to = room<4>(4 + length + 1);
      store(to, static_cast<std::uint32_t>(length + 1));
      copy_short(to + 4, value.data(), length + 1);
    } else {
      std::uint8_t * const to = room<4>(4 + 4 * length);
      store(to, static_cast<std::uint32_t>(length));
      for (std::size_t position = 0; position < length; ++position) {
        store(to + 4 + 4 * position, value[position]);
      }
    }
  }

  template<typename Message>
  FORGE_CDR_INLINE void message(const Message & value)
  {
    Members<Message>::visit(*this, value);
  }

  template<typename Value, std::size_t Size>
  FORGE_CDR_INLINE void array(const std::array<Value, Size> & values, std::size_t = unbounded)
  {
    items<Value>(values);
  }

  template<typename Sequence>
  FORGE_CDR_INLINE void sequence(const Sequence & values, std::size_t = unbounded)
  {
    store(room<4>(4), static_cast<std::uint32_t>(values.size()));
    if (!values.empty()) {
      items<typename Sequence::value_type>(values);
    }
  }

private:
  /// Advance to a multiple of the alignment, and then by the size, which is at least the alignment.
  template<std::size_t Alignment>
  FORGE_CDR_INLINE std::uint8_t * room(std::size_t size)
  {
    if constexpr (Alignment > 1) {
      std::memset(_body + _offset, 0, Alignment);  // clears the padding; the value is written after it
      _offset = aligned(_offset, Alignment);
    }
    std::uint8_t * const found = _body + _offset;
    _offset += size;
    return found;
  }

  template<typename Value>
  static FORGE_CDR_INLINE void put(std::uint8_t * run, std::size_t & offset, const Value & value)
  {
    const std::size_t start = aligned(offset, Leaf<Value>::alignment);
    if (start != offset) {
      std::memset(run + offset, 0, start - offset);
    }
    store(run + start, value);
    offset = start + Leaf<Value>::size;
  }

  template<typename Value>
  static FORGE_CDR_INLINE void store(std::uint8_t * to, const Value & value)
  {
    if constexpr (std::is_arithmetic_v<Value>) {
      copy_number<sizeof(Value), !host_is_little>(to, &value);
    } else if constexpr (host_is_little) {
      copy_exactly<sizeof(Value)>(to, &value);
    } else {
      Writer(to).message(value);
    }
  }

  static FORGE_CDR_INLINE void store(std::uint8_t * to, char16_t value)
  {
    store(to, static_cast<std::uint32_t>(value));
  }

  /// Six of the sixteen bytes of an x87 long double are padding.
  static FORGE_CDR_INLINE void store(std::uint8_t * to, long double value)
  {
    static_assert(sizeof(long double) <= 16, "wider than on any wire");
#if defined __LDBL_MANT_DIG__ && __LDBL_MANT_DIG__ == 64
    constexpr std::size_t significant = 10;
#else
    constexpr std::size_t significant = sizeof(long double);
#endif
    std::memset(to, 0, 16);
    std::memcpy(to, &value, significant);
  }

  template<typename Value, std::size_t Size>
  static FORGE_CDR_INLINE void store(std::uint8_t * to, const std::array<Value, Size> & values)
  {
    if constexpr (host_is_little && (is_packed<Value>() || std::is_same_v<Value, bool>)) {
      copy_exactly<sizeof(values)>(to, values.data());
    } else {
      for (std::size_t position = 0; position < Size; ++position) {
        store(to + position * Leaf<Value>::size, values[position]);
      }
    }
  }

  template<typename Value, typename Range>
  FORGE_CDR_INLINE void items(const Range & values)
  {
    if constexpr (host_is_little && is_packed<Value>()) {
      const std::size_t size = values.size() * sizeof(Value);
      std::memcpy(room<Leaf<Value>::alignment>(size), values.data(), size);
    } else if constexpr (std::is_arithmetic_v<Value>) {
      std::uint8_t * to = room<Leaf<Value>::alignment>(values.size() * Leaf<Value>::size);
      for (const Value value : values) {
        store(to, value);
        to += Leaf<Value>::size;
      }
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

  std::uint8_t * const _body;
  std::size_t _offset = 0;
};

}  // namespace forge_cdr::detail

#endif  // FORGE_CDR__DETAIL__WRITER_HPP_
