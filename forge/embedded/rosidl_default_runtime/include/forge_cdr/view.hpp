// A view of a sequence inside serialized data, without copying it.
//
//   sensor_msgs::msg::Image rest;
//   const auto pixels = forge_cdr::view(data, size, rest, &sensor_msgs::msg::Image::data);
//
// All other members are read as usual. The view is valid as long as the data.

#ifndef FORGE_CDR__VIEW_HPP_
#define FORGE_CDR__VIEW_HPP_

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "forge_cdr/detail/reader.hpp"
#include "forge_cdr/detail/types.hpp"
#include "forge_cdr/forge_cdr.hpp"

namespace forge_cdr
{

/// Elements of fixed size inside serialized data, of any byte order and alignment.
template<typename Value>
class View
{
public:
  View() noexcept = default;

  View(const std::uint8_t * bytes, std::size_t size, bool swapped) noexcept
  : _bytes(bytes), _size(size), _swapped(swapped)
  {
  }

  /// The number of elements.
  std::size_t size() const noexcept
  {
    return _size;
  }

  bool empty() const noexcept
  {
    return _size == 0;
  }

  /// The element at an index less than size(), by value, because it may be unaligned.
  Value operator[](std::size_t position) const
  {
    constexpr std::size_t size = detail::Leaf<Value>::size;
    const std::uint8_t * const from = _bytes + position * size;
    Value value;
    if (_swapped) {
      detail::Reader<true>(from, size).fixed(value);
    } else {
      detail::Reader<false>(from, size).fixed(value);
    }
    return value;
  }

  /// The first byte of the first element; the bytes are in host order unless swapped().
  const std::uint8_t * bytes() const noexcept
  {
    return _bytes;
  }

  /// True if the byte order differs from that of the host.
  bool swapped() const noexcept
  {
    return _swapped;
  }

private:
  const std::uint8_t * _bytes = nullptr;
  std::size_t _size = 0;
  bool _swapped = false;
};

namespace detail
{

/// Reads members like a Reader, except for one sequence, whose position it records.
template<bool Swap, typename Wanted>
class Viewer
{
public:
  using Value = typename Wanted::value_type;

  Viewer(const std::uint8_t * body, std::size_t size, const Wanted & wanted) noexcept
  : _reader(body, size), _wanted(&wanted)
  {
  }

  View<Value> found() const noexcept
  {
    return _found;
  }

  template<typename ... Leaves>
  void fixed(Leaves & ... leaves)
  {
    _reader.fixed(leaves ...);
  }

  template<typename Text>
  void text(Text & value, std::size_t bound = unbounded)
  {
    _reader.text(value, bound);
  }

  template<typename Message>
  void message(Message & value)
  {
    _reader.message(value);
  }

  template<typename Array>
  void array(Array & values, std::size_t bound = unbounded)
  {
    _reader.array(values, bound);
  }

  template<typename Sequence>
  void sequence(Sequence & values, std::size_t bound = unbounded)
  {
    if constexpr (std::is_same_v<Sequence, Wanted>) {
      if (&values == _wanted) {
        const auto [bytes, count] = _reader.elements(values);
        _found = View<Value>(bytes, count, Swap);
        values.clear();
        return;
      }
    }
    _reader.sequence(values, bound);
  }

private:
  Reader<Swap> _reader;
  const Wanted * const _wanted;
  View<Value> _found;
};

template<bool Swap, typename Message, typename Wanted>
View<typename Wanted::value_type> read_around(
  const std::uint8_t * data, std::size_t size, Message & message, const Wanted & wanted)
{
  Viewer<Swap, Wanted> viewer(data + header_size, size - header_size, wanted);
  Members<Message>::visit(viewer, message);
  return viewer.found();
}

}  // namespace detail

/// Read a message except for one of its direct sequences, which is left empty, and return a view of that sequence.
/**
 * The elements must be of fixed size: numbers, or messages without padding. Throws as deserialize().
 */
template<typename Message, typename Sequence>
View<typename Sequence::value_type> view(
  const std::uint8_t * data, std::size_t size, Message & message, Sequence Message::* member)
{
  View<typename Sequence::value_type> found;
  detail::read_whole(
    data, size, message, [&](auto swap) {
      found = detail::read_around<decltype(swap)::value>(data, size, message, message.*member);
    });
  return found;
}

}  // namespace forge_cdr

#endif  // FORGE_CDR__VIEW_HPP_
