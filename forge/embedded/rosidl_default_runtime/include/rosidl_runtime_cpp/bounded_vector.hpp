#ifndef ROSIDL_RUNTIME_CPP__BOUNDED_VECTOR_HPP_
#define ROSIDL_RUNTIME_CPP__BOUNDED_VECTOR_HPP_

#include "rosidl_runtime_cpp/requires_cpp17.hpp"

#include <cstddef>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

namespace rosidl_runtime_cpp
{

/// A std::vector of at most UpperBound values; exceeding the bound throws std::length_error.
/**
 * It inherits privately, so that the bound cannot be exceeded through a reference to the base class.
 * An operation that would exceed the bound leaves the vector unchanged.
 */
template<typename Value, std::size_t UpperBound, typename Allocator = std::allocator<Value>>
class BoundedVector : protected std::vector<Value, Allocator>
{
  using Base = std::vector<Value, Allocator>;

  template<typename Iterator>
  using IfIterator = std::enable_if_t<
    std::is_convertible_v<
      typename std::iterator_traits<Iterator>::iterator_category, std::input_iterator_tag>,
    int>;

public:
  using typename Base::allocator_type;
  using typename Base::const_iterator;
  using typename Base::const_pointer;
  using typename Base::const_reference;
  using typename Base::const_reverse_iterator;
  using typename Base::difference_type;
  using typename Base::iterator;
  using typename Base::pointer;
  using typename Base::reference;
  using typename Base::reverse_iterator;
  using typename Base::size_type;
  using typename Base::value_type;

  BoundedVector() = default;

  explicit BoundedVector(const Allocator & allocator) noexcept
  : Base(allocator)
  {
  }

  explicit BoundedVector(size_type count, const Allocator & allocator = Allocator())
  : Base(checked(count), allocator)
  {
  }

  BoundedVector(size_type count, const Value & value, const Allocator & allocator = Allocator())
  : Base(checked(count), value, allocator)
  {
  }

  BoundedVector(const BoundedVector &) = default;
  BoundedVector(BoundedVector &&) = default;

  BoundedVector(const BoundedVector & other, const Allocator & allocator)
  : Base(other, allocator)
  {
  }

  BoundedVector(BoundedVector && other, const Allocator & allocator)
  : Base(static_cast<Base &&>(other), allocator)
  {
  }

  BoundedVector(std::initializer_list<Value> values, const Allocator & allocator = Allocator())
  : Base(allocator)
  {
    assign(values);
  }

  template<typename Iterator, IfIterator<Iterator> = 0>
  BoundedVector(Iterator first, Iterator last, const Allocator & allocator = Allocator())
  : Base(allocator)
  {
    assign(first, last);
  }

  ~BoundedVector() = default;

  BoundedVector & operator=(const BoundedVector &) = default;
  BoundedVector & operator=(BoundedVector &&) = default;

  BoundedVector & operator=(std::initializer_list<Value> values)
  {
    assign(values);
    return *this;
  }

  void assign(size_type count, const Value & value)
  {
    Base::assign(checked(count), value);
  }

  template<typename Iterator, IfIterator<Iterator> = 0>
  void assign(Iterator first, Iterator last)
  {
    if constexpr (can_be_counted<Iterator>()) {
      checked_distance(first, last);
      Base::assign(first, last);
    } else {
      Base::operator=(collected(first, last, UpperBound));
    }
  }

  void assign(std::initializer_list<Value> values)
  {
    checked(values.size());
    Base::assign(values);
  }

  using Base::get_allocator;

  using Base::at;
  using Base::operator[];
  using Base::back;
  using Base::front;

  /// Pointer to the values; not available for bool, whose values are bits.
  template<typename Element = Value, std::enable_if_t<!std::is_same_v<Element, bool>, int> = 0>
  Element * data() noexcept
  {
    return Base::data();
  }

  template<typename Element = Value, std::enable_if_t<!std::is_same_v<Element, bool>, int> = 0>
  const Element * data() const noexcept
  {
    return Base::data();
  }

  using Base::begin;
  using Base::cbegin;
  using Base::cend;
  using Base::crbegin;
  using Base::crend;
  using Base::end;
  using Base::rbegin;
  using Base::rend;

  using Base::capacity;
  using Base::empty;
  using Base::shrink_to_fit;
  using Base::size;

  size_type max_size() const noexcept
  {
    return Base::max_size() < UpperBound ? Base::max_size() : UpperBound;
  }

  void reserve(size_type count)
  {
    Base::reserve(checked(count));
  }

  void resize(size_type count)
  {
    Base::resize(checked(count));
  }

  void resize(size_type count, const Value & value)
  {
    Base::resize(checked(count), value);
  }

  using Base::clear;
  using Base::erase;
  using Base::pop_back;

  void push_back(const Value & value)
  {
    check_room(1);
    Base::push_back(value);
  }

  void push_back(Value && value)
  {
    check_room(1);
    Base::push_back(std::move(value));
  }

  template<typename ... Arguments>
  decltype(auto) emplace_back(Arguments && ... arguments)
  {
    check_room(1);
    return Base::emplace_back(std::forward<Arguments>(arguments)...);
  }

  template<typename ... Arguments>
  iterator emplace(const_iterator position, Arguments && ... arguments)
  {
    check_room(1);
    return Base::emplace(position, std::forward<Arguments>(arguments)...);
  }

  iterator insert(const_iterator position, const Value & value)
  {
    check_room(1);
    return Base::insert(position, value);
  }

  iterator insert(const_iterator position, Value && value)
  {
    check_room(1);
    return Base::insert(position, std::move(value));
  }

  iterator insert(const_iterator position, size_type count, const Value & value)
  {
    check_room(count);
    return Base::insert(position, count, value);
  }

  iterator insert(const_iterator position, std::initializer_list<Value> values)
  {
    check_room(values.size());
    return Base::insert(position, values);
  }

  template<typename Iterator, IfIterator<Iterator> = 0>
  iterator insert(const_iterator position, Iterator first, Iterator last)
  {
    if constexpr (can_be_counted<Iterator>()) {
      check_room(checked_distance(first, last));
      return Base::insert(position, first, last);
    } else {
      const Base values = collected(first, last, UpperBound - size());
      return Base::insert(position, values.begin(), values.end());
    }
  }

  void swap(BoundedVector & other) noexcept(noexcept(std::declval<Base &>().swap(other)))
  {
    Base::swap(other);
  }

  friend void swap(BoundedVector & left, BoundedVector & right)
  {
    left.swap(right);
  }

  friend bool operator==(const BoundedVector & left, const BoundedVector & right)
  {
    return left.base() == right.base();
  }

  friend bool operator!=(const BoundedVector & left, const BoundedVector & right)
  {
    return left.base() != right.base();
  }

  friend bool operator<(const BoundedVector & left, const BoundedVector & right)
  {
    return left.base() < right.base();
  }

  friend bool operator>(const BoundedVector & left, const BoundedVector & right)
  {
    return left.base() > right.base();
  }

  friend bool operator<=(const BoundedVector & left, const BoundedVector & right)
  {
    return left.base() <= right.base();
  }

  friend bool operator>=(const BoundedVector & left, const BoundedVector & right)
  {
    return left.base() >= right.base();
  }

private:
  const Base & base() const noexcept
  {
    return *this;
  }

  static size_type checked(size_type count)
  {
    if (count > UpperBound) {
      throw std::length_error("Exceeded upper bound");
    }
    return count;
  }

  void check_room(size_type count) const
  {
    if (count > UpperBound - size()) {
      throw std::length_error("Exceeded upper bound");
    }
  }

  template<typename Iterator>
  static constexpr bool can_be_counted()
  {
    return std::is_convertible_v<
      typename std::iterator_traits<Iterator>::iterator_category, std::forward_iterator_tag>;
  }

  template<typename Iterator>
  static size_type checked_distance(Iterator first, Iterator last)
  {
    return checked(static_cast<size_type>(std::distance(first, last)));
  }

  /// Collect the values of a single-pass range; throws if there are more than `room`.
  template<typename Iterator>
  Base collected(Iterator first, Iterator last, size_type room) const
  {
    Base values(get_allocator());
    for (; first != last; ++first) {
      if (values.size() == room) {
        throw std::length_error("Exceeded upper bound");
      }
      values.push_back(*first);
    }
    return values;
  }
};

}  // namespace rosidl_runtime_cpp

#endif  // ROSIDL_RUNTIME_CPP__BOUNDED_VECTOR_HPP_
