// Messages whose strings and vectors come from an allocator of the program's own.

#include <cassert>
#include <cstddef>
#include <memory>

#include "rover/msg/route.hpp"
#include "std_msgs/msg/string.hpp"

namespace allocating
{

std::size_t count = 0;

template<typename T>
struct Counting
{
  using value_type = T;

  Counting() = default;

  template<typename U>
  Counting(const Counting<U> &) noexcept {}  // NOLINT: allocators convert into each other

  T * allocate(std::size_t n)
  {
    ++count;
    return std::allocator<T>().allocate(n);
  }

  void deallocate(T * memory, std::size_t n)
  {
    std::allocator<T>().deallocate(memory, n);
  }

  template<typename U>
  bool operator==(const Counting<U> &) const {return true;}

  template<typename U>
  bool operator!=(const Counting<U> &) const {return false;}
};

template<>
struct Counting<void>
{
  using value_type = void;
};

void run()
{
  using Text = std_msgs::msg::String_<Counting<void>>;
  Text text;
  text.data = "a text that is too long for the space inside a string";
  assert(count == 1);
  const Text copy = text;
  assert(count == 2 && copy == text);

  rover::msg::Route_<Counting<void>> route{Counting<void>()};
  count = 0;
  route.waypoints.resize(2);
  route.sketch.push_back(1);
  assert(count == 2 && route.waypoints[1].speed == 0.5);
}

}  // namespace allocating
