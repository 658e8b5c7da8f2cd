// ROS 2 messages to bytes and back: classic CDR (XCDR1), as on the wire and in rosbag2 files.
//
//   std::vector<std::uint8_t> data = forge_cdr::serialize(message);
//   forge_cdr::deserialize(data.data(), data.size(), message);
//
// Takes every message whose header forge has generated. Little endian is written, both byte orders are
// read. forge brings these headers along with its own run time; rosidl's has none of this name.

#ifndef FORGE_CDR__FORGE_CDR_HPP_
#define FORGE_CDR__FORGE_CDR_HPP_

#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "forge_cdr/detail/reader.hpp"
#include "forge_cdr/detail/sizer.hpp"
#include "forge_cdr/detail/types.hpp"
#include "forge_cdr/detail/writer.hpp"
#include "forge_cdr/error.hpp"
#include "forge_cdr/members.hpp"
#include "rosidl_runtime_cpp/message_initialization.hpp"

namespace forge_cdr
{

namespace detail
{

constexpr std::size_t header_size = 4;
constexpr std::size_t largest = 0xffffffff;

[[noreturn]] FORGE_CDR_COLD inline void fail_large(std::size_t size)
{
  throw Error("a message of " + std::to_string(size) + " bytes is too large for CDR");
}

[[noreturn]] FORGE_CDR_COLD inline void fail_capacity(std::size_t size, std::size_t capacity)
{
  throw Error(
    std::to_string(size) + " bytes needed, there is room for " + std::to_string(capacity));
}

[[noreturn]] FORGE_CDR_COLD inline void fail_header(const std::uint8_t * data, std::size_t size)
{
  if (size < header_size) {
    throw Error(std::to_string(size) + " bytes are too few for a header of 4");
  }
  throw Error(
    "the header begins with " + std::to_string(data[0]) + " " + std::to_string(data[1]) +
    ", that of classic CDR with 0 0 or 0 1");
}

template<typename Message>
FORGE_CDR_INLINE void write(const Message & message, std::uint8_t * data)
{
  data[0] = 0;
  data[1] = 1;  // little endian
  data[2] = 0;
  data[3] = 0;
  Writer writer(data + header_size);
  writer.message(message);
}

template<bool Swap, typename Message>
void read(const std::uint8_t * data, std::size_t size, Message & message)
{
  Reader<Swap> reader(data + header_size, size - header_size);
  reader.message(message);
}

/// Look at the header and have all members read: `read` is told by a type if bytes are to be swapped.
template<typename Message, typename Read>
FORGE_CDR_INLINE void read_whole(
  const std::uint8_t * data, std::size_t size, Message & message, const Read & read)
{
  try {
    if (size < header_size || data[0] != 0 || data[1] > 1) {
      fail_header(data, size);
    }
    const bool little = data[1] == 1;
    if (little == host_is_little) {
      read(std::false_type());
    } else {
      read(std::true_type());
    }
  } catch (...) {
    message = Message(::rosidl_runtime_cpp::MessageInitialization::ALL);
    throw;
  }
}

}  // namespace detail

/// Return how many bytes a message takes, header included.
/**
 * Throws Error if they are more than a uint32 can count.
 */
template<typename Message>
std::size_t size(const Message & message)
{
  detail::Sizer sizer;
  sizer.message(message);
  const std::size_t size = detail::header_size + sizer.offset();
  if (size > detail::largest) {
    detail::fail_large(size);
  }
  return size;
}

/// Write a message to memory that there is and return how many bytes it took: those that size() tells.
/**
 * Throws Error if there is not that much room, before anything is written.
 */
template<typename Message>
std::size_t serialize_into(const Message & message, std::uint8_t * data, std::size_t capacity)
{
  const std::size_t needed = size(message);
  if (needed > capacity) {
    detail::fail_capacity(needed, capacity);
  }
  detail::write(message, data);
  return needed;
}

/// Write a message to a vector, which gets the size of the message and keeps its memory if that suffices.
template<typename Message, typename Allocator>
void serialize_into(const Message & message, std::vector<std::uint8_t, Allocator> & data)
{
  data.resize(size(message));
  detail::write(message, data.data());
}

/// Return a message's bytes, header included.
template<typename Message>
std::vector<std::uint8_t> serialize(const Message & message)
{
  std::vector<std::uint8_t> data(size(message));
  detail::write(message, data.data());
  return data;
}

/// Read a message into one that there is; its strings and sequences keep their memory where that suffices.
/**
 * Bytes behind the message are ignored, as are the options in the header. Throws Error when the bytes hold
 * no such message, std::bad_alloc when memory is short; the message is as newly made then.
 */
template<typename Message>
void deserialize(const std::uint8_t * data, std::size_t size, Message & message)
{
  detail::read_whole(
    data, size, message, [&](auto swap) {
      detail::read<decltype(swap)::value>(data, size, message);
    });
}

/// Read a message into one that there is, from a vector; as above.
template<typename Message, typename Allocator>
void deserialize(const std::vector<std::uint8_t, Allocator> & data, Message & message)
{
  deserialize(data.data(), data.size(), message);
}

/// Return the message that the bytes hold; as above.
template<typename Message>
Message deserialize(const std::uint8_t * data, std::size_t size)
{
  Message message(::rosidl_runtime_cpp::MessageInitialization::SKIP);
  deserialize(data, size, message);
  return message;
}

}  // namespace forge_cdr

#endif  // FORGE_CDR__FORGE_CDR_HPP_
