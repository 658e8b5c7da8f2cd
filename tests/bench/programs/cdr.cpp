// Time forge_cdr beside Fast-CDR, in turns; print a JSON object: case, variant, nanoseconds for one message in
// each turn.
//
// Processors stumble where a load and a store before it agree in the last 12 bits of their addresses, which
// depends on where memory happens to be. So the bytes lie elsewhere in each turn, for both sides alike.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <malloc.h>

#include "forge_cdr/forge_cdr.hpp"
#include "peer.hpp"

namespace
{

using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::uint8_t>;

constexpr int lengths[] = {3, 9, 4, 17, 8, 31, 12, 5};
constexpr double turn_seconds = 0.002;

int turns = 61;
bool first_case = true;

double seconds_of(const std::function<void()> & all, int times)
{
  const auto start = Clock::now();
  for (int time = 0; time < times; ++time) {
    all();
  }
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Variant
{
  std::string name;
  /// Handles every message once.
  std::function<void()> all;
  std::vector<double> nanoseconds;
};

/// A message's bytes, or room for them, somewhere in an arena.
struct Place
{
  std::uint8_t * data;
  std::size_t size;
};

template<typename Message>
[[gnu::noinline]] void ours_write(const Message & message, Place buffer)
{
  forge_cdr::serialize_into(message, buffer.data, buffer.size);
}

template<typename Message>
[[gnu::noinline]] void theirs_write(const Message & message, Place buffer)
{
  const std::size_t size = peer_size(message);
  if (size <= buffer.size) {
    peer_serialize(message, reinterpret_cast<char *>(buffer.data), size);
  }
}

template<typename Message>
[[gnu::noinline]] void ours_read(Place from, Message & message)
{
  forge_cdr::deserialize(from.data, from.size, message);
}

template<typename Message>
[[gnu::noinline]] void theirs_read(Place from, Message & message)
{
  peer_deserialize(reinterpret_cast<const char *>(from.data), from.size, message);
}

/// The bytes of all messages, and room to write each, at places that change.
class Arena
{
public:
  explicit Arena(const std::vector<Bytes> & data)
  : _data(data)
  {
    std::size_t size = 8192;
    for (const Bytes & each : data) {
      size += 2 * (each.size() + 16);
    }
    _memory.resize(size);
    move_to(0);
  }

  void move_to(int turn)
  {
    std::uint8_t * next = _memory.data() + (turn * 272) % 4096;
    const auto taken = [&next](std::size_t size) {
        std::uint8_t * const found = next;
        next += (size + 15) / 16 * 16;  // as memory that malloc hands out
        return Place{found, size};
      };
    places.clear();
    std::size_t largest = 0;
    for (const Bytes & each : _data) {
      places.push_back(taken(each.size()));
      std::copy(each.begin(), each.end(), places.back().data);
      largest = std::max(largest, each.size());
    }
    buffer = taken(largest);
  }

  std::vector<Place> places;
  Place buffer{nullptr, 0};

private:
  const std::vector<Bytes> & _data;
  Bytes _memory;
};

template<typename Message>
Bytes both_write(const Message & message)
{
  const Bytes ours = forge_cdr::serialize(message);
  Bytes theirs(peer_size(message));  // zero, as Fast-CDR leaves padding as it is
  peer_serialize(message, reinterpret_cast<char *>(theirs.data()), theirs.size());
  Message same;
  peer_deserialize(reinterpret_cast<const char *>(ours.data()), ours.size(), same);
  if (ours != theirs || same != message) {
    std::fprintf(stderr, "the two sides disagree\n");
    std::exit(1);
  }
  return ours;
}

void run(const char * name, std::size_t messages, std::vector<Variant> & variants, Arena & arena)
{
  for (Variant & variant : variants) {
    seconds_of(variant.all, 3);
  }
  for (int turn = 0; turn < turns; ++turn) {
    arena.move_to(turn);
    for (Variant & variant : variants) {
      const double once = std::max(seconds_of(variant.all, 1), 1e-9);
      const int times = std::max(1, static_cast<int>(turn_seconds / once));
      const double taken = seconds_of(variant.all, times);
      variant.nanoseconds.push_back(1e9 * taken / times / static_cast<double>(messages));
    }
  }
  std::printf("%s\n\"%s\": {", first_case ? "" : ",", name);
  first_case = false;
  for (Variant & variant : variants) {
    std::printf("%s\"%s\": [", &variant == variants.data() ? "" : ", ", variant.name.c_str());
    for (std::size_t turn = 0; turn < variant.nanoseconds.size(); ++turn) {
      std::printf("%s%.2f", turn ? ", " : "", variant.nanoseconds[turn]);
    }
    std::printf("]");
  }
  std::printf("}");
}

/// Measure a type; `make` returns a message with strings of that length.
template<typename Message>
void measure(const char * name, const std::function<Message(int)> & make, bool varied = true)
{
  std::vector<Message> messages;
  std::vector<Bytes> data;
  for (const int length : lengths) {
    messages.push_back(make(varied ? length : 15));
    data.push_back(both_write(messages.back()));
    if (data.back().size() > 100000) {
      break;
    }
  }
  Arena arena(data);
  Message used_by_ours = messages.front();
  Message used_by_theirs = messages.front();
  const auto each_message = [&](const auto & what) {
      return [&messages, what]() {for (const Message & message : messages) {what(message);}};
    };
  const auto each_place = [&](const auto & what) {
      return [&arena, what]() {for (const Place place : arena.places) {what(place);}};
    };
  std::vector<Variant> variants{
    {"Fast-CDR write", each_message([&](const Message & message) {theirs_write(message, arena.buffer);}), {}},
    {"forge write", each_message([&](const Message & message) {ours_write(message, arena.buffer);}), {}},
    {"Fast-CDR read, used", each_place([&](Place from) {theirs_read(from, used_by_theirs);}), {}},
    {"forge read, used", each_place([&](Place from) {ours_read(from, used_by_ours);}), {}},
    {"Fast-CDR read, fresh", each_place([](Place from) {Message fresh; theirs_read(from, fresh);}), {}},
    {"forge read, fresh", each_place([](Place from) {Message fresh; ours_read(from, fresh);}), {}}};
  run(name, messages.size(), variants, arena);
}

std_msgs::msg::Header header(int length)
{
  std_msgs::msg::Header made;
  made.stamp.sec = 1700000000;
  made.stamp.nanosec = 123456789;
  made.frame_id = std::string(static_cast<std::size_t>(length), 'f');
  return made;
}

geometry_msgs::msg::PoseStamped pose(int length)
{
  geometry_msgs::msg::PoseStamped made;
  made.header = header(length);
  made.pose.position.x = 1.5;
  return made;
}

nav_msgs::msg::Path path(int length)
{
  nav_msgs::msg::Path made;
  made.header = header(length);
  for (int position = 0; position < 100; ++position) {
    made.poses.push_back(pose(lengths[position % 8]));
  }
  return made;
}

sensor_msgs::msg::Imu imu(int length)
{
  sensor_msgs::msg::Imu made;
  made.header = header(length);
  made.angular_velocity.z = 0.25;
  return made;
}

sensor_msgs::msg::LaserScan scan(int length)
{
  sensor_msgs::msg::LaserScan made;
  made.header = header(length);
  made.ranges.assign(720, 3.25f);
  return made;
}

sensor_msgs::msg::JointState joints(int length)
{
  sensor_msgs::msg::JointState made;
  made.header = header(length);
  for (int joint = 0; joint < 12; ++joint) {
    made.name.push_back(std::string(static_cast<std::size_t>(lengths[joint % 8]), 'j'));
  }
  made.position.assign(12, 0.5);
  made.velocity.assign(12, 0.25);
  return made;
}

sensor_msgs::msg::PointCloud2 cloud(int length)
{
  sensor_msgs::msg::PointCloud2 made;
  made.header = header(length);
  for (const char * name : {"x", "y", "z", "intensity"}) {
    made.fields.emplace_back();
    made.fields.back().name = name;
    made.fields.back().datatype = 7;
    made.fields.back().count = 1;
  }
  made.data.assign(1000000, 5);
  return made;
}

sensor_msgs::msg::Image image(int length)
{
  sensor_msgs::msg::Image made;
  made.header = header(length);
  made.encoding = "rgb8";
  made.data.assign(1000000, 5);
  return made;
}

geometry_msgs::msg::Polygon polygon(int)
{
  geometry_msgs::msg::Polygon made;
  made.points.resize(1000);
  made.points[7].x = 1.5f;
  return made;
}

std_msgs::msg::String text(int length)
{
  std_msgs::msg::String made;
  made.data = std::string(static_cast<std::size_t>(length), 's');
  return made;
}

}  // namespace

int main(int argc, char ** argv)
{
  // Memory that the system takes back and gives again would cost more than all else.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  if (argc > 1) {
    turns = std::atoi(argv[1]);
  }
  std::printf("{");
  measure<std_msgs::msg::String>("String of 15", text, false);
  measure<std_msgs::msg::String>("String, varied", text);
  measure<sensor_msgs::msg::Imu>("Imu", imu);
  measure<geometry_msgs::msg::PoseStamped>("PoseStamped", pose);
  measure<nav_msgs::msg::Path>("Path of 100", path);
  measure<sensor_msgs::msg::JointState>("JointState of 12", joints);
  measure<sensor_msgs::msg::LaserScan>("LaserScan 720", scan);
  measure<geometry_msgs::msg::Polygon>("Polygon 1000", polygon);
  measure<sensor_msgs::msg::PointCloud2>("PointCloud2 1 MB", cloud);
  measure<sensor_msgs::msg::Image>("Image 1 MB", image);
  std::printf("\n}\n");
  return 0;
}
