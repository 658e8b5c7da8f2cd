#ifndef FORGE_CDR__DETAIL__READER_HPP_
#define FORGE_CDR__DETAIL__READER_HPP_

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>

#include "forge_cdr/detail/types.hpp"
#include "forge_cdr/error.hpp"
#include "rosidl_runtime_cpp/message_initialization.hpp"

namespace forge_cdr::detail
{

/// Reads members; invalid data never causes out-of-bounds reads or disproportionate allocations.
/**
 * Swap is true if the byte order of the data differs from that of the host.
 */
template<bool Swap>
class Reader
{
public:
  /// `body` is the first byte after the header; alignment is relative to it.
  Reader(const std::uint8_t * body, std::size_t size) noexcept
  : _body(body), _size(size)
  {
  }

  template<typename ... Leaves>
  FORGE_CDR_INLINE void fixed(Leaves & ... leaves)
  {
    const std::uint8_t * const run = take<Run<Leaves...>::alignment>(Run<Leaves...>::size);
    std::size_t offset = 0;
    (get(run, offset, leaves), ...);
  }

  template<typename Text>
  FORGE_CDR_INLINE void text(Text & value, std::size_t bound = unbounded)
  {
    const std::size_t length = number();
    if constexpr (std::is_same_v<typename Text::value_type, char>) {
      if (length > _size - _offset) {
        fail_short(length);
      }
      narrow(value, length, bound);
    } else {
      if (length > (_size - _offset) / 4) {
        fail_count(length);
      }
      wide(value, length);
      if (length > bound) {
        check_length(characters(value.data(), length), bound);
      }
    }
  }

  template<typename Message>
  FORGE_CDR_INLINE void message(Message & value)
  {
    if constexpr (Swap) {
      message_swapped(value);
    } else {
      Members<Message>::visit(*this, value);
    }
  }

  template<typename Value, std::size_t Size>
  FORGE_CDR_INLINE void array(
    std::array<Value, Size> & values, [[maybe_unused]] std::size_t bound = unbounded)
  {
    if constexpr (!Swap && is_packed<Value>()) {
      std::memcpy(values.data(), take<Leaf<Value>::alignment>(sizeof(values)), sizeof(values));
    } else {
      for (Value & value : values) {
        item(value, bound);
      }
    }
  }

  template<typename Sequence>
  FORGE_CDR_INLINE void sequence(Sequence & values, [[maybe_unused]] std::size_t bound = unbounded)
  {
    using Value = typename Sequence::value_type;
    const std::size_t count = length(values);
    if (count == 0) {
      values.clear();
    } else if constexpr (!Swap && is_packed<Value>()) {
      const std::uint8_t * const from = take<Leaf<Value>::alignment>(count * sizeof(Value));
      assign_packed(values, from, count);
    } else if constexpr (std::is_arithmetic_v<Value>) {
      const std::uint8_t * from = take<Leaf<Value>::alignment>(count * Leaf<Value>::size);
      values.resize(count);
      for (std::size_t position = 0; position < count; ++position) {
        Value value;
        load(from + position * Leaf<Value>::size, value);
        values[position] = value;
      }
    } else {
      read_each(values, count, bound);
    }
  }

  /// Return the first element of a sequence and the number of elements, without reading them.
  template<typename Sequence>
  std::pair<const std::uint8_t *, std::size_t> elements(const Sequence & values)
  {
    using Value = typename Sequence::value_type;
    static_assert(
      std::is_arithmetic_v<Value> || is_packed<Value>(), "only elements of fixed size can be viewed");
    const std::size_t count = length(values);
    if (count == 0) {
      return {nullptr, 0};
    }
    return {take<Leaf<Value>::alignment>(count * Leaf<Value>::size), count};
  }

private:
  /// Not inlined: data of the other byte order is rare, and inlining doubles the compile time of large messages.
  template<typename Message>
  FORGE_CDR_COLD void message_swapped(Message & value)
  {
    Members<Message>::visit(*this, value);
  }

  /// Read and check the length of a sequence.
  template<typename Sequence>
  FORGE_CDR_INLINE std::size_t length(const Sequence & values)
  {
    const std::size_t count = number();
    if (count > (_size - _offset) / least<typename Sequence::value_type>()) {
      fail_count(count);
    }
    if (count > values.max_size()) {
      fail_bound(count, values.max_size());
    }
    return count;
  }

  /// Return the next bytes, after padding.
  template<std::size_t Alignment>
  FORGE_CDR_INLINE const std::uint8_t * take(std::size_t size)
  {
    const std::size_t start = aligned(_offset, Alignment);
    if (start > _size || size > _size - start) {
      fail_short(size);
    }
    _offset = start + size;
    return _body + start;
  }

  FORGE_CDR_INLINE std::size_t number()
  {
    std::uint32_t value;
    load(take<4>(4), value);
    return value;
  }

  /// Read a string of the given size, which usually ends with a NUL.
  template<typename Text>
  FORGE_CDR_INLINE void narrow(Text & value, std::size_t size, std::size_t bound)
  {
    const auto * const from = reinterpret_cast<const char *>(_body + _offset);
    const std::size_t length = size > 0 && from[size - 1] == '\0' ? size - 1 : size;
    if (length > bound) {
      check_length(characters(from, length), bound);
    }
    _offset += size;
    if (value.size() == length) {
      copy_short(value.data(), from, length);
    } else if (value.capacity() < length) {
      // Create and move a new string, which is faster than growing with assign().
      value = Text(from, length, value.get_allocator());
    } else {
      value.assign(from, length);
    }
  }

  /// Read a wstring of the given number of UTF-16 code units, four bytes each.
  template<typename Text>
  FORGE_CDR_INLINE void wide(Text & value, std::size_t length)
  {
    value.resize(length);
    for (std::size_t position = 0; position < length; ++position) {
      char16_t unit;
      load(_body + _offset, unit);
      value[position] = unit;
      _offset += 4;
    }
  }

  template<typename Sequence>
  FORGE_CDR_INLINE void assign_packed(Sequence & values, const std::uint8_t * from, std::size_t count)
  {
    using Value = typename Sequence::value_type;
    if (values.size() != count) {
      if constexpr (std::is_arithmetic_v<Value>) {
        if (reinterpret_cast<std::uintptr_t>(from) % alignof(Value) == 0) {
          const auto * const first = reinterpret_cast<const Value *>(from);
          values.assign(first, first + count);  // resize() would write zeros first
          return;
        }
      }
      values.resize(count);
    }
    std::memcpy(static_cast<void *>(values.data()), from, count * sizeof(Value));
  }

  /// Read strings or messages; existing elements keep their memory.
  template<typename Sequence>
  FORGE_CDR_INLINE void read_each(
    Sequence & values, std::size_t count, [[maybe_unused]] std::size_t bound)
  {
    using Value = typename Sequence::value_type;
    if constexpr (IsText<Value>::value) {
      values.resize(count);
      for (Value & value : values) {
        text(value, bound);
      }
    } else {
      if (count < values.size()) {
        values.erase(values.begin() + static_cast<std::ptrdiff_t>(count), values.end());
      }
      values.reserve(count);
      // One call for existing and new elements: what it inlines is compiled once.
      for (std::size_t position = 0; position < count; ++position) {
        if (position == values.size()) {
          values.emplace_back(::rosidl_runtime_cpp::MessageInitialization::SKIP);
        }
        message(values[position]);
      }
    }
  }

  template<typename Value>
  FORGE_CDR_INLINE void item(Value & value, [[maybe_unused]] std::size_t bound)
  {
    if constexpr (IsText<Value>::value) {
      text(value, bound);
    } else {
      message(value);
    }
  }

  template<typename Value>
  FORGE_CDR_INLINE void get(const std::uint8_t * run, std::size_t & offset, Value & value)
  {
    offset = aligned(offset, Leaf<Value>::alignment);
    load(run + offset, value);
    offset += Leaf<Value>::size;
  }

  template<typename Value>
  FORGE_CDR_INLINE void load(const std::uint8_t * from, Value & value)
  {
    if constexpr (std::is_arithmetic_v<Value>) {
      copy_number<sizeof(Value), Swap>(&value, from);
    } else if constexpr (!Swap) {
      copy_exactly<sizeof(Value)>(&value, from);
    } else {
      Reader(from, sizeof(Value)).message(value);
    }
  }

  FORGE_CDR_INLINE void load(const std::uint8_t * from, bool & value)
  {
    value = *from != 0;
  }

  FORGE_CDR_INLINE void load(const std::uint8_t * from, char16_t & value)
  {
    std::uint32_t unit;
    load(from, unit);
    if (unit > 0xffff) {
      fail_unit(unit);
    }
    value = static_cast<char16_t>(unit);
  }

  template<typename Value, std::size_t Size>
  FORGE_CDR_INLINE void load(const std::uint8_t * from, std::array<Value, Size> & values)
  {
    if constexpr (!Swap && is_packed<Value>()) {
      copy_exactly<sizeof(values)>(values.data(), from);
    } else {
      for (std::size_t position = 0; position < Size; ++position) {
        load(from + position * Leaf<Value>::size, values[position]);
      }
    }
  }

  [[noreturn]] FORGE_CDR_COLD void fail_short(std::size_t needed) const
  {
    fail(std::to_string(needed) + " bytes needed, " + left() + " left");
  }

  [[noreturn]] FORGE_CDR_COLD void fail_count(std::size_t count) const
  {
    fail(std::to_string(count) + " elements in " + left() + " bytes");
  }

  [[noreturn]] FORGE_CDR_COLD void fail_bound(std::size_t count, std::size_t bound) const
  {
    fail(std::to_string(count) + " elements, " + std::to_string(bound) + " are allowed");
  }

  FORGE_CDR_COLD void check_length(std::size_t length, std::size_t bound) const
  {
    if (length > bound) {
      fail("a string of " + std::to_string(length) + " characters, " + std::to_string(bound) + " are allowed");
    }
  }

  [[noreturn]] FORGE_CDR_COLD void fail_unit(std::uint32_t unit) const
  {
    fail(std::to_string(unit) + " is not a UTF-16 code unit");
  }

  [[noreturn]] FORGE_CDR_COLD void fail(const std::string & problem) const
  {
    throw Error("at byte " + std::to_string(_offset + 4) + ": " + problem);
  }

  std::string left() const
  {
    return std::to_string(_size - _offset);
  }

  const std::uint8_t * const _body;
  const std::size_t _size;
  std::size_t _offset = 0;
};

}  // namespace forge_cdr::detail

#endif  // FORGE_CDR__DETAIL__READER_HPP_
