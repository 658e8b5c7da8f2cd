// What tests of forge_cdr share: an own, slow writer to compare with, random messages, spoilt bytes, memory counted.

#ifndef CDR_CHECKS_HPP_
#define CDR_CHECKS_HPP_

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

#include "forge_cdr/forge_cdr.hpp"

using Bytes = std::vector<std::uint8_t>;

/// Bytes that operator new has handed out since `asked` was set to zero; a test has one source file.
inline std::size_t asked = 0;

void * operator new(std::size_t size)
{
  asked += size;
  if (void * found = std::malloc(size > 0 ? size : 1)) {
    return found;
  }
  throw std::bad_alloc();
}

void operator delete(void * pointer) noexcept
{
  std::free(pointer);
}

void operator delete(void * pointer, std::size_t) noexcept
{
  std::free(pointer);
}

/// The wire format as its definition says it: byte by byte, one value after the other, in either order.
class PlainWriter
{
public:
  explicit PlainWriter(bool big_endian)
  : bytes{0, static_cast<std::uint8_t>(big_endian ? 0 : 1), 0, 0}, _big_endian(big_endian)
  {
  }

  template<typename ... Leaves>
  void fixed(const Leaves & ... leaves)
  {
    (leaf(leaves), ...);
  }

  template<typename Text>
  void text(const Text & value, std::size_t = 0)
  {
    const bool narrow = sizeof(typename Text::value_type) == 1;
    leaf(static_cast<std::uint32_t>(value.size() + (narrow ? 1 : 0)));
    for (const auto character : value) {
      leaf(character);
    }
    if (narrow) {
      bytes.push_back(0);
    }
  }

  template<typename Message>
  void message(const Message & value)
  {
    forge_cdr::Members<Message>::visit(*this, value);
  }

  template<typename Range>
  void array(const Range & values, std::size_t = 0)
  {
    using Value = typename Range::value_type;
    for (const Value & value : values) {
      if constexpr (std::is_arithmetic_v<Value>) {
        leaf(value);
      } else if constexpr (forge_cdr::detail::IsText<Value>::value) {
        text(value);
      } else {
        message(value);
      }
    }
  }

  template<typename Range>
  void sequence(const Range & values, std::size_t = 0)
  {
    leaf(static_cast<std::uint32_t>(values.size()));
    array(values);
  }

  Bytes bytes;

private:
  template<typename Value>
  void leaf(const Value & value)
  {
    if constexpr (std::is_class_v<Value>) {
      message(value);
    } else if constexpr (std::is_same_v<Value, char16_t>) {
      leaf(static_cast<std::uint32_t>(value));
    } else {
      while ((bytes.size() - 4) % sizeof(Value) != 0) {
        bytes.push_back(0);
      }
      std::uint8_t own[sizeof(Value)];
      std::memcpy(own, &value, sizeof(Value));
      if (_big_endian) {
        std::reverse(own, own + sizeof(Value));
      }
      bytes.insert(bytes.end(), own, own + sizeof(Value));
    }
  }

  template<typename Value, std::size_t Size>
  void leaf(const std::array<Value, Size> & values)
  {
    for (const Value & value : values) {
      leaf(value);
    }
  }

  bool _big_endian;
};

template<typename Message>
Bytes plainly(const Message & message, bool big_endian)
{
  PlainWriter writer(big_endian);
  writer.message(message);
  return writer.bytes;
}

/// Gives every member some value; texts and sequences are short.
class Filler
{
public:
  explicit Filler(std::mt19937 & chance)
  : _chance(chance)
  {
  }

  template<typename ... Leaves>
  void fixed(Leaves & ... leaves)
  {
    (leaf(leaves), ...);
  }

  template<typename Text>
  void text(Text & value, std::size_t bound = 39)
  {
    value.resize(length(bound + 1));
    for (auto & character : value) {
      character = static_cast<typename Text::value_type>('a' + _chance() % 26);
    }
  }

  template<typename Message>
  void message(Message & value)
  {
    forge_cdr::Members<Message>::visit(*this, value);
  }

  template<typename Range>
  void array(Range & values, [[maybe_unused]] std::size_t bound = 39)
  {
    using Value = typename Range::value_type;
    for (std::size_t position = 0; position < values.size(); ++position) {
      if constexpr (std::is_arithmetic_v<Value>) {
        Value value;
        leaf(value);
        values[position] = value;
      } else if constexpr (forge_cdr::detail::IsText<Value>::value) {
        text(values[position], bound);
      } else {
        message(values[position]);
      }
    }
  }

  template<typename Range>
  void sequence(Range & values, std::size_t bound = 39)
  {
    values.resize(length(std::min<std::size_t>(5, values.max_size() + 1)));
    array(values, bound);
  }

private:
  std::size_t length(std::size_t end)
  {
    return _chance() % end;
  }

  template<typename Value>
  void leaf(Value & value)
  {
    if constexpr (std::is_class_v<Value>) {
      message(value);
    } else if constexpr (std::is_same_v<Value, bool>) {
      value = _chance() % 2 == 0;
    } else {
      value = static_cast<Value>(static_cast<std::int32_t>(_chance()));
    }
  }

  template<typename Value, std::size_t Size>
  void leaf(std::array<Value, Size> & values)
  {
    for (Value & value : values) {
      leaf(value);
    }
  }

  std::mt19937 & _chance;
};

/// Read bytes that end where their memory ends, so that a look beyond is noticed; tell if they were taken.
template<typename Message>
bool reads(const Bytes & bytes, std::size_t size, Message & message)
{
  const std::unique_ptr<std::uint8_t[]> exact(new std::uint8_t[size]);
  std::copy_n(bytes.begin(), size, exact.get());
  try {
    forge_cdr::deserialize(exact.get(), size, message);
    return true;
  } catch (const forge_cdr::Error &) {
    return false;
  }
}

/// Change a few bytes, most of them to what is likely to matter, or cut some off.
inline void spoil(Bytes & bytes, std::mt19937 & chance)
{
  static constexpr std::uint8_t likely[] = {0, 1, 2, 0x7f, 0x80, 0xff};
  for (std::size_t times = 1 + chance() % 4; times > 0; --times) {
    const bool random = chance() % 4 == 0;
    bytes[chance() % bytes.size()] = static_cast<std::uint8_t>(random ? chance() : likely[chance() % 6]);
  }
  if (chance() % 8 == 0) {
    bytes.resize(4 + chance() % (bytes.size() - 3));
  }
  bytes[0] = 0;
  bytes[1] &= 1;
}

/// Tell if spoilt bytes of messages of a type are refused or taken, with memory in proportion.
/**
 * What is taken can be written and read again.
 */
template<typename Message>
bool survives(std::size_t times, std::mt19937 & chance)
{
  Bytes good;
  for (std::size_t turn = 0; turn < times; ++turn) {
    if (turn % 16 == 0) {
      Message filled;
      Filler(chance).message(filled);
      good = plainly(filled, chance() % 2 == 0);
    }
    Bytes bytes = good;
    spoil(bytes, chance);
    Message message;
    asked = 0;
    const bool taken = reads(bytes, bytes.size(), message);
    // A string or vector in memory takes eight times what it takes on the wire at least.
    if (asked > 64 * bytes.size() + 1024) {
      return false;
    }
    if (!taken && forge_cdr::serialize(message) != forge_cdr::serialize(Message())) {
      return false;
    }
    if (taken) {
      const Bytes again = forge_cdr::serialize(message);
      Message same;
      if (again != plainly(message, false) || !reads(again, again.size(), same) ||
        forge_cdr::serialize(same) != again)
      {
        return false;
      }
    }
  }
  return true;
}

#endif  // CDR_CHECKS_HPP_
