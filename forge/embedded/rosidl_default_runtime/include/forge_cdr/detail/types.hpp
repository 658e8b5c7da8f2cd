// Serialized size and alignment of values, and whether the serialized bytes equal those in memory.

#ifndef FORGE_CDR__DETAIL__TYPES_HPP_
#define FORGE_CDR__DETAIL__TYPES_HPP_

#include "rosidl_runtime_cpp/requires_cpp17.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>

#include "forge_cdr/members.hpp"

// Sizers, writers and readers are fast only if they are inlined.
#if defined __GNUC__
#define FORGE_CDR_INLINE inline __attribute__((always_inline))
#define FORGE_CDR_COLD __attribute__((cold, noinline))
#else
#define FORGE_CDR_INLINE inline
#define FORGE_CDR_COLD
#endif

namespace forge_cdr::detail
{

#if defined __BYTE_ORDER__ && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
constexpr bool host_is_little = false;
#else
constexpr bool host_is_little = true;
#endif

static_assert(sizeof(bool) == 1, "a bool is a byte on the wire");

constexpr std::size_t aligned(std::size_t offset, std::size_t alignment) noexcept
{
  return (offset + alignment - 1) & ~(alignment - 1);
}

/// A value of fixed size: a number, a bool, a character, an array of those, or a packed message.
template<typename Value, bool IsMessage = std::is_class_v<Value>>
struct Leaf
{
  static constexpr std::size_t size = sizeof(Value);
  static constexpr std::size_t alignment = sizeof(Value);
};

template<typename Message>
struct Leaf<Message, true>
{
  static constexpr std::size_t size = Members<Message>::packed;
  static constexpr std::size_t alignment = Members<Message>::alignment;
  static_assert(size == sizeof(Message) && std::is_trivially_copyable_v<Message>, "no packed message");
};

template<>
struct Leaf<char16_t>
{
  static constexpr std::size_t size = 4;
  static constexpr std::size_t alignment = 4;
};

template<>
struct Leaf<long double>
{
  static constexpr std::size_t size = 16;
  static constexpr std::size_t alignment = 8;
};

template<typename Value, std::size_t Size>
struct Leaf<std::array<Value, Size>, true>
{
  static constexpr std::size_t size = Size * Leaf<Value>::size;
  static constexpr std::size_t alignment = Leaf<Value>::alignment;
};

/// Adjacent values, the first of which has the largest alignment: all padding between them is known.
template<typename First, typename ... Others>
struct Run
{
  static constexpr std::size_t alignment = Leaf<First>::alignment;
  static_assert(
    ((Leaf<Others>::alignment <= alignment) && ...), "padding would depend on what comes before");

  static constexpr std::size_t measured() noexcept
  {
    std::size_t offset = Leaf<First>::size;
    ((offset = aligned(offset, Leaf<Others>::alignment) + Leaf<Others>::size), ...);
    return offset;
  }

  static constexpr std::size_t size = measured();
};

/// The upper bound of strings that have none.
constexpr std::size_t unbounded = static_cast<std::size_t>(-1);

template<typename Value>
struct IsText : std::false_type {};

template<typename Traits, typename Allocator>
struct IsText<std::basic_string<char, Traits, Allocator>>: std::true_type {};

template<typename Traits, typename Allocator>
struct IsText<std::basic_string<char16_t, Traits, Allocator>>: std::true_type {};

/// Return the number of characters in UTF-8 or UTF-16; units that continue a character do not count.
template<typename Unit>
FORGE_CDR_COLD inline std::size_t characters(const Unit * text, std::size_t size) noexcept
{
  std::size_t count = 0;
  for (std::size_t position = 0; position < size; ++position) {
    if constexpr (sizeof(Unit) == 1) {
      count += (static_cast<unsigned char>(text[position]) & 0xc0u) != 0x80u;
    } else {
      count += (text[position] & 0xfc00u) != 0xdc00u;
    }
  }
  return count;
}

/// The minimum serialized size of a value.
template<typename Value>
constexpr std::size_t least() noexcept
{
  if constexpr (IsText<Value>::value) {
    return 4;
  } else if constexpr (std::is_arithmetic_v<Value>) {
    return Leaf<Value>::size;
  } else {
    return Members<Value>::least;
  }
}

/// True if the bytes of consecutive values in memory equal the serialized ones, in the byte order of the host.
template<typename Value>
constexpr bool is_packed() noexcept
{
  if constexpr (IsText<Value>::value || std::is_same_v<Value, bool>) {
    return false;  // not every byte is a valid bool
  } else if constexpr (std::is_arithmetic_v<Value>) {
    return Leaf<Value>::size == sizeof(Value) && !std::is_same_v<Value, long double>;
  } else {
    return Members<Value>::packed == sizeof(Value) && std::is_trivially_copyable_v<Value>;
  }
}

/// Copy mostly short data with one or two moves instead of a call.
FORGE_CDR_INLINE void copy_short(void * to, const void * from, std::size_t size)
{
  auto * const target = static_cast<unsigned char *>(to);
  const auto * const source = static_cast<const unsigned char *>(from);
  if (size > 32) {
    std::memcpy(target, source, size);
  } else if (size >= 16) {
    unsigned char head[16];
    unsigned char tail[16];
    std::memcpy(head, source, 16);
    std::memcpy(tail, source + size - 16, 16);
    std::memcpy(target, head, 16);
    std::memcpy(target + size - 16, tail, 16);
  } else if (size >= 8) {
    std::uint64_t head;
    std::uint64_t tail;
    std::memcpy(&head, source, 8);
    std::memcpy(&tail, source + size - 8, 8);
    std::memcpy(target, &head, 8);
    std::memcpy(target + size - 8, &tail, 8);
  } else if (size >= 4) {
    std::uint32_t head;
    std::uint32_t tail;
    std::memcpy(&head, source, 4);
    std::memcpy(&tail, source + size - 4, 4);
    std::memcpy(target, &head, 4);
    std::memcpy(target + size - 4, &tail, 4);
  } else if (size > 0) {
    target[0] = source[0];
    target[size / 2] = source[size / 2];
    target[size - 1] = source[size - 1];
  }
}

/// Copy a fixed number of bytes without a function call.
template<std::size_t Size>
FORGE_CDR_INLINE void copy_exactly(void * to, const void * from)
{
  if constexpr (Size <= 16 || Size > 512) {
    std::memcpy(to, from, Size);
  } else {
    std::memcpy(to, from, 16);
    copy_exactly<Size - 16>(static_cast<unsigned char *>(to) + 16, static_cast<const unsigned char *>(from) + 16);
  }
}

/// Copy the bytes of a number, and reverse them if the byte orders differ.
template<std::size_t Size, bool Swap>
FORGE_CDR_INLINE void copy_number(void * to, const void * from)
{
  if constexpr (Swap && Size > 1) {
    auto * const target = static_cast<unsigned char *>(to);
    const auto * const source = static_cast<const unsigned char *>(from);
    for (std::size_t position = 0; position < Size; ++position) {
      target[position] = source[Size - 1 - position];
    }
  } else {
    std::memcpy(to, from, Size);
  }
}

}  // namespace forge_cdr::detail

#endif  // FORGE_CDR__DETAIL__TYPES_HPP_
