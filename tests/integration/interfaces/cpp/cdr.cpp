// The wire format in C++: exits with the number of checks that do not hold.
// Given a number, reads that many spoilt buffers of each type as well; given a second one, with that seed.

#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

#include "cdr_checks.hpp"
#include "example_interfaces/action/fibonacci.hpp"
#include "example_interfaces/msg/w_string.hpp"
#include "example_interfaces/srv/add_two_ints.hpp"
#include "forge_cdr/view.hpp"
#include "geometry_msgs/msg/point_stamped.hpp"
#include "geometry_msgs/msg/polygon.hpp"
#include "nav_msgs/msg/path.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/joint_state.hpp"
#include "std_msgs/msg/bool.hpp"
#include "std_msgs/msg/empty.hpp"
#include "std_msgs/msg/float64.hpp"
#include "std_msgs/msg/header.hpp"
#include "std_msgs/msg/string.hpp"
#include "std_msgs/msg/u_int8_multi_array.hpp"
#include "wire/msg/around.hpp"
#include "wire/msg/arr.hpp"
#include "wire/msg/basic_types.hpp"
#include "wire/msg/big.hpp"
#include "wire/msg/bnd.hpp"
#include "wire/msg/collections.hpp"
#include "wire/msg/empty_in.hpp"
#include "wire/msg/letters.hpp"
#include "wire/msg/limits.hpp"
#include "wire/msg/nest.hpp"
#include "wire/msg/seq.hpp"
#include "wire/msg/strs.hpp"
#include "wire/msg/w.hpp"

namespace
{

int failures = 0;

#define HOLDS(condition) holds((condition), #condition, __LINE__)
#define VECTOR(number, message, text) vector((number), (message), (text))

void holds(bool condition, const std::string & text, int line)
{
  if (!condition) {
    std::cerr << "line " << line << ": does not hold: " << text << "\n";
    ++failures;
  }
}

Bytes bytes_of(const std::string & text)
{
  Bytes bytes{0, 1, 0, 0};
  std::string digits;
  for (const char character : text) {
    if (character != ' ') {
      digits += character;
    }
    if (digits.size() == 2) {
      bytes.push_back(static_cast<std::uint8_t>(std::stoi(digits, nullptr, 16)));
      digits.clear();
    }
  }
  return bytes;
}

template<typename Message>
bool is_read(const Bytes & bytes, const Message & expected)
{
  Message message;
  return reads(bytes, bytes.size(), message) && message == expected;
}

/// What holds for every message: it is read as written, in both orders, and never when something is missing.
template<typename Message>
void round_trip(const Message & message, const std::string & name)
{
  const Bytes bytes = forge_cdr::serialize(message);
  holds(forge_cdr::size(message) == bytes.size(), name + ": size", 0);
  holds(plainly(message, false) == bytes, name + ": as written plainly", 0);
  Bytes dirty(bytes.size(), 0xee);
  holds(forge_cdr::serialize_into(message, dirty.data(), dirty.size()) == bytes.size(), name, 0);
  holds(dirty == bytes, name + ": every byte is written, padding too", 0);
  for (const bool big_endian : {false, true}) {
    const Bytes plain = plainly(message, big_endian);
    holds(is_read(plain, message), name + (big_endian ? ": big endian" : ": little endian"), 0);
    for (std::size_t size = 0; size < plain.size(); size += 1 + plain.size() / 400) {
      Message cut = message;
      holds(!reads(plain, size, cut), name + ": cut to " + std::to_string(size), 0);
      holds(cut == Message(), name + ": as newly made after an error", 0);
    }
    Bytes more = plain;
    more.push_back(7);
    more[2] = 0xff;
    holds(is_read(more, message), name + ": options and what follows are ignored", 0);
  }
}

template<typename Message>
void vector(const std::string & number, const Message & message, const std::string & text)
{
  holds(forge_cdr::serialize(message) == bytes_of(text), "vector " + number, 0);
  round_trip(message, "vector " + number);
}

std_msgs::msg::Header header(std::int32_t sec, std::uint32_t nanosec, const std::string & frame_id)
{
  std_msgs::msg::Header made;
  made.stamp.sec = sec;
  made.stamp.nanosec = nanosec;
  made.frame_id = frame_id;
  return made;
}

void vectors_of_standard_messages()
{
  VECTOR("1", std_msgs::msg::String().set__data("hello"), "06000000 68656c6c6f00");
  VECTOR("2", std_msgs::msg::String(), "01000000 00");
  VECTOR("3", std_msgs::msg::String().set__data("\303\251"), "03000000 c3a900");
  VECTOR("4", std_msgs::msg::Empty(), "00");
  VECTOR("5", std_msgs::msg::Bool().set__data(true), "01");
  VECTOR("6", std_msgs::msg::Float64().set__data(1.5), "000000000000f83f");
  VECTOR("7", header(1, 2, "map"), "01000000 02000000 04000000 6d617000");
  geometry_msgs::msg::PointStamped point;
  point.header = header(1, 2, "map");
  point.point.x = 1.0;
  point.point.y = 2.0;
  point.point.z = 3.0;
  VECTOR(
    "8", point,
    "01000000 02000000 04000000 6d617000 000000000000f03f 0000000000000040 0000000000000840");
  VECTOR(
    "9", std_msgs::msg::UInt8MultiArray().set__data({1, 2, 3}), "00000000 00000000 03000000 010203");
  VECTOR(
    "10", sensor_msgs::msg::JointState().set__name({"a", "bc"}).set__position({0.5, -0.5}),
    "00000000 00000000 01000000 00 000000 02000000 02000000 6100 0000 03000000 626300 00 02000000"
    "000000000000e03f 000000000000e0bf 00000000 00000000");
  VECTOR(
    "11",
    sensor_msgs::msg::Image().set__header(header(0, 0, "c")).set__height(1).set__width(2)
    .set__encoding("mono8").set__step(2).set__data({7, 8}),
    "00000000 00000000 02000000 6300 0000 01000000 02000000 06000000 6d6f6e6f3800 00 00 02000000"
    "02000000 0708");
}

void vectors_of_own_messages()
{
  VECTOR(
    "12",
    wire::build<wire::msg::BasicTypes>().a(true).b(0x7f).c(65).d(1.125f).e(1.125).f(-1).g(2).h(-3)
    .i(4).j(-5).k(6).l(-7).m(8),
    "01 7f 41 00 0000903f 000000000000f23f ff 02 fdff 0400 0000 fbffffff 06000000 f9ffffffffffffff"
    "0800000000000000");
  VECTOR(
    "13", wire::build<wire::msg::Seq>().e({}).b(2).f({1.0}),
    "00000000 02 000000 01000000 00000000 000000000000f03f");
  const auto inner = [](std::uint8_t a, double b) {
      return wire::msg::Inner().set__a(a).set__b(b);
    };
  wire::msg::Nest nest;
  nest.p = 1;
  nest.arr = {inner(2, 1.0), inner(3, 2.0)};
  nest.q = 5;
  VECTOR(
    "15", nest, "01 02 000000000000 000000000000f03f 03 00000000000000 0000000000000040 00000000 05");
  nest.seq.push_back(inner(4, 3.0));
  VECTOR(
    "14", nest,
    "01 02 000000000000 000000000000f03f 03 00000000000000 0000000000000040 01000000 04 000000"
    "0000000000000840 05");
  VECTOR(
    "16",
    wire::build<wire::msg::Strs>().a({"x", ""}).b({"", "yz"}).c({true, false})
    .d({true, false, true}).e(258),
    "02000000 02000000 7800 0000 01000000 00 000000 01000000 00 000000 03000000 797a00 00 02000000"
    "0100 010001 00 0201");
  VECTOR(
    "17", wire::build<wire::msg::Big>().a(1).b(2).c(3).d(4).e(5).f(6),
    "01 00000000000000 0200000000000000 03 000000 04000000 05 00 0600");
  VECTOR(
    "18", wire::build<wire::msg::Arr>().a(1).b({1.0}).c({2, 3, 4}).d({5, 6}),
    "01 00000000000000 000000000000f03f 020304 00 05000000 06000000");
  VECTOR(
    "19", wire::build<wire::msg::Bnd>().s("ab").v({-1}).t(9),
    "03000000 616200 00 01000000 ffffffff 09");
  VECTOR("20", wire::msg::EmptyIn().set__x(1), "00 000000 01000000");
}

void vectors_of_services_actions_and_wide_text()
{
  example_interfaces::srv::AddTwoInts::Request request;
  VECTOR("21", request.set__a(1).set__b(2), "0100000000000000 0200000000000000");
  using Fibonacci = example_interfaces::action::Fibonacci;
  Fibonacci::Impl::SendGoalService::Request goal;
  Fibonacci::Impl::FeedbackMessage feedback;
  for (std::uint8_t number = 0; number < 16; ++number) {
    goal.goal_id.uuid[number] = feedback.goal_id.uuid[number] = number;
  }
  goal.goal.order = 5;
  feedback.feedback.sequence = {0, 1, 1};
  VECTOR("22", goal, "000102030405060708090a0b0c0d0e0f 05000000");
  VECTOR("23", feedback, "000102030405060708090a0b0c0d0e0f 03000000 00000000 01000000 01000000");
  using example_interfaces::msg::WString;
  VECTOR("W1", WString().set__data(u"h\u00e9"), "02000000 68000000 e9000000");
  VECTOR("W2", WString(), "00000000");
  VECTOR("W3", WString().set__data(u"\U0001f600"), "02000000 3dd80000 00de0000");
  VECTOR(
    "W4", wire::build<wire::msg::W>().w(u"a").t(7).ws({u"b"}).wa({u"", u"c"}),
    "01000000 61000000 07 000000 01000000 01000000 62000000 00000000 01000000 63000000");
}

template<typename ... Messages>
struct Types
{
  static void round_trips(std::mt19937 & chance)
  {
    (filled<Messages>(chance), ...);
  }

  static bool survive(std::size_t times, std::mt19937 & chance)
  {
    return (survives<Messages>(times, chance) && ...);
  }

  template<typename Message>
  static void filled(std::mt19937 & chance)
  {
    for (int turn = 0; turn < 4; ++turn) {
      Message message;
      Filler(chance).message(message);
      round_trip(message, rosidl_generator_traits::name<Message>());
    }
  }
};

using All = Types<
  wire::msg::Around, wire::msg::Arr, wire::msg::BasicTypes, wire::msg::Bnd, wire::msg::Collections,
  wire::msg::EmptyIn, wire::msg::Letters, wire::msg::Nest, wire::msg::Strs, wire::msg::W,
  geometry_msgs::msg::Polygon, nav_msgs::msg::Path, sensor_msgs::msg::JointState>;

/// What error there is, without the bytes it is about.
template<typename Message>
std::string refusal(const Bytes & bytes)
{
  try {
    forge_cdr::deserialize<Message>(bytes.data(), bytes.size());
  } catch (const forge_cdr::Error & error) {
    return error.what();
  }
  return "";
}

void odd_bytes_are_taken()
{
  const std_msgs::msg::String hi = std_msgs::msg::String().set__data("hi");
  HOLDS(is_read(bytes_of("00000000"), std_msgs::msg::String()));
  HOLDS(is_read(bytes_of("02000000 6869"), hi));
  HOLDS(is_read(bytes_of("03000000 686900"), hi));
  HOLDS(is_read(bytes_of("04000000 68690000"), std_msgs::msg::String().set__data(std::string("hi\0", 3))));
  HOLDS(is_read(bytes_of("ff"), std_msgs::msg::Bool().set__data(true)));
  HOLDS(
    is_read(
      bytes_of("01 ffffffffffffff 0200000000000000 03 ffffff 04000000 05 ff 0600"),
      wire::build<wire::msg::Big>().a(1).b(2).c(3).d(4).e(5).f(6)));
  const std::string flags = "00000000 01000000 00 ffffff 01000000 00 ffffff 02000000 0200 ff8000 ff 0201";
  HOLDS(
    is_read(
      bytes_of(flags),
      wire::build<wire::msg::Strs>().a({}).b({"", ""}).c({true, false}).d({true, true, false}).e(258)));
}

void errors_say_what_and_where()
{
  using std_msgs::msg::String;
  HOLDS(refusal<String>({0, 1, 0}) == "3 bytes are too few for a header of 4");
  HOLDS(
    refusal<String>({0, 7, 0, 0}) ==
    "the header begins with 0 7, that of classic CDR with 0 0 or 0 1");
  HOLDS(refusal<String>(bytes_of("0600")) == "at byte 4: 4 bytes needed, 2 left");
  HOLDS(refusal<String>(bytes_of("06000000 6869")) == "at byte 8: 6 bytes needed, 2 left");
  HOLDS(refusal<wire::msg::Seq>(bytes_of("ffffff7f 00")) == "at byte 8: 2147483647 elements in 1 bytes");
  HOLDS(
    refusal<wire::msg::Bnd>(bytes_of("01000000 00 000000 05000000" + std::string(40, '0'))) ==
    "at byte 16: 5 elements, 4 are allowed");
  HOLDS(
    refusal<wire::msg::Bnd>(bytes_of("0c000000 6161616161616161616161 00 00000000 00")) ==
    "at byte 8: a string of 11 characters, 10 are allowed");
  HOLDS(
    refusal<example_interfaces::msg::WString>(bytes_of("01000000 00000100")) ==
    "at byte 8: 65536 is not a UTF-16 code unit");
  std_msgs::msg::String text = String().set__data("hello");
  Bytes small(9, 0xee);
  try {
    forge_cdr::serialize_into(text, small.data(), small.size());
    HOLDS(false);
  } catch (const forge_cdr::Error & error) {
    HOLDS(error.what() == std::string("14 bytes needed, there is room for 9"));
  }
  HOLDS(small == Bytes(9, 0xee));
}

void a_used_message_keeps_its_memory()
{
  std::mt19937 chance(3);
  nav_msgs::msg::Path path;
  path.header.frame_id = std::string(40, 'm');
  for (int turn = 0; turn < 3; ++turn) {
    path.poses.emplace_back();
    path.poses.back().header.frame_id = std::string(30, static_cast<char>('a' + turn));
  }
  const Bytes bytes = forge_cdr::serialize(path);
  nav_msgs::msg::Path used;
  forge_cdr::deserialize(bytes, used);
  const auto * const poses = used.poses.data();
  const char * const frame = used.poses[1].header.frame_id.data();
  asked = 0;
  forge_cdr::deserialize(bytes, used);
  HOLDS(asked == 0);
  HOLDS(used == path && used.poses.data() == poses && used.poses[1].header.frame_id.data() == frame);
  path.poses.pop_back();
  forge_cdr::deserialize(forge_cdr::serialize(path), used);
  HOLDS(used == path && used.poses.data() == poses);
  Bytes data;
  forge_cdr::serialize_into(path, data);
  HOLDS(data == forge_cdr::serialize(path));
  asked = 0;
  forge_cdr::serialize_into(path, data);
  HOLDS(asked == 0);
  HOLDS((forge_cdr::deserialize<nav_msgs::msg::Path>(data.data(), data.size()) == path));
}

/// A view has the elements that a read would have copied, whatever the byte order; the rest is read.
template<typename Message, typename Sequence>
void views(const Message & message, Sequence Message::* member, const std::string & name)
{
  Message rest = message;
  (rest.*member).clear();
  for (const bool big_endian : {false, true}) {
    const Bytes bytes = plainly(message, big_endian);
    Message read = message;
    const auto view = forge_cdr::view(bytes.data(), bytes.size(), read, member);
    holds(read == rest, name + ": all but the view is read", 0);
    holds(view.size() == (message.*member).size(), name + ": size", 0);
    holds(view.empty() == (message.*member).empty(), name + ": empty", 0);
    holds(view.swapped() == big_endian, name + ": order", 0);
    for (std::size_t position = 0; position < view.size(); ++position) {
      holds(view[position] == (message.*member)[position], name + ": element", 0);
    }
    holds(
      view.empty() || (view.bytes() > bytes.data() && view.bytes() < bytes.data() + bytes.size()),
      name + ": within the bytes", 0);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      try {
        forge_cdr::view(bytes.data(), size, read, member);
        holds(false, name + ": cut", 0);
      } catch (const forge_cdr::Error &) {
        holds(read == Message(), name + ": as newly made after an error", 0);
      }
    }
  }
}

void sequences_are_viewed_where_they_are()
{
  sensor_msgs::msg::Image image;
  image.header = header(1, 2, "camera");
  image.encoding = "mono8";
  image.data = {7, 8, 9};
  views(image, &sensor_msgs::msg::Image::data, "view of bytes");
  const Bytes bytes = forge_cdr::serialize(image);
  sensor_msgs::msg::Image read = image;
  asked = 0;
  const auto pixels = forge_cdr::view(bytes.data(), bytes.size(), read, &sensor_msgs::msg::Image::data);
  HOLDS(asked == 0);
  HOLDS(pixels.bytes() == bytes.data() + bytes.size() - 3 && !pixels.swapped());
  const auto joints = sensor_msgs::msg::JointState().set__name({"a"}).set__position({0.5, -1.5});
  views(joints, &sensor_msgs::msg::JointState::position, "view of doubles");
  views(joints, &sensor_msgs::msg::JointState::effort, "view of nothing");
  geometry_msgs::msg::Polygon polygon;
  polygon.points.resize(3);
  polygon.points[1].y = 2.5f;
  views(polygon, &geometry_msgs::msg::Polygon::points, "view of messages");
  views(
    wire::build<wire::msg::Strs>().a({"x"}).b({"", "yz"}).c({true, false}).d({true, false, true}).e(258),
    &wire::msg::Strs::c, "view of bools");
  views(
    wire::build<wire::msg::Bnd>().s("ab").v({-1, 2}).t(9), &wire::msg::Bnd::v, "view of a bounded sequence");
}

/// The bounds of strings count characters: not bytes of UTF-8, nor the halves of pairs in UTF-16.
void bounded_strings_are_checked()
{
  wire::msg::Limits message;
  message.brief = {"\xc3\xa9\xc3\xa9\xc3\xa9"};
  message.wide = u"\U0001F600\U0001F600";
  message.two[1] = "abc";
  round_trip(message, "bounded strings");
  const auto refused = [](const wire::msg::Limits & changed, const std::string & words) {
      try {
        forge_cdr::serialize(changed);
        return false;
      } catch (const forge_cdr::Error & error) {
        return error.what() == words;
      }
    };
  wire::msg::Limits changed = message;
  changed.brief[0] += "a";
  HOLDS(refused(changed, "a string of 4 characters, 3 are allowed"));
  changed = message;
  changed.two[0] = "abcd";
  HOLDS(refused(changed, "a string of 4 characters, 3 are allowed"));
  changed = message;
  changed.wide += u"a";
  HOLDS(refused(changed, "a string of 3 characters, 2 are allowed"));
  HOLDS(
    refusal<wire::msg::Limits>(bytes_of("00000000 03000000 61000000 61000000 61000000")) ==
    "at byte 24: a string of 3 characters, 2 are allowed");
}

void every_bit_of_a_number_survives()
{
  wire::msg::BasicTypes message;
  message.d = -0.0f;
  message.e = std::numeric_limits<double>::quiet_NaN();
  message.l = std::numeric_limits<std::int64_t>::min();
  message.m = std::numeric_limits<std::uint64_t>::max();
  const Bytes bytes = forge_cdr::serialize(message);
  const auto same = forge_cdr::deserialize<wire::msg::BasicTypes>(bytes.data(), bytes.size());
  HOLDS(forge_cdr::serialize(same) == bytes);
  HOLDS(same.l == message.l && same.m == message.m && same.e != same.e);
}

}  // namespace

int main(int argc, char ** argv)
{
  vectors_of_standard_messages();
  vectors_of_own_messages();
  vectors_of_services_actions_and_wide_text();
  odd_bytes_are_taken();
  errors_say_what_and_where();
  a_used_message_keeps_its_memory();
  sequences_are_viewed_where_they_are();
  bounded_strings_are_checked();
  every_bit_of_a_number_survives();
  std::mt19937 chance(argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1u);
  All::round_trips(chance);
  if (argc > 1) {
    HOLDS(All::survive(static_cast<std::size_t>(std::atol(argv[1])), chance));
  }
  return failures > 100 ? 100 : failures;
}
