// What programs do with messages: exits with the number of checks that do not hold.

#include <iostream>
#include <iterator>
#include <list>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "example_interfaces/action/fibonacci.hpp"
#include "example_interfaces/srv/add_two_ints.hpp"
#include "geometry_msgs/msg/point.hpp"
#include "geometry_msgs/msg/pose.hpp"
#include "geometry_msgs/msg/pose_stamped.hpp"
#include "probe/msg/bounded.hpp"
#include "probe/msg/constants.hpp"
#include "probe/msg/defaults.hpp"
#include "probe/msg/empty.hpp"
#include "probe/msg/http_server.hpp"
#include "probe/msg/names.hpp"
#include "probe/msg/nest.hpp"
#include "probe/msg/nothings.hpp"
#include "probe/msg/plain.hpp"
#include "probe/msg/points.hpp"
#include "probe/msg/small.hpp"
#include "probe/msg/strings.hpp"
#include "probe/msg/wide.hpp"
#include "builder/srv/ask.hpp"
#include "msg/msg/outer.hpp"
#include "std_srvs/srv/empty.hpp"

using rosidl_runtime_cpp::MessageInitialization;
namespace traits = rosidl_generator_traits;

namespace
{

int failures = 0;

#define HOLDS(condition) holds((condition), #condition, __LINE__)
#define READS(actual, expected) reads((actual), (expected), __LINE__)

void holds(bool condition, const char * text, int line)
{
  if (!condition) {
    std::cerr << "line " << line << ": does not hold: " << text << "\n";
    ++failures;
  }
}

void reads(const std::string & actual, const std::string & expected, int line)
{
  if (actual != expected) {
    std::cerr << "line " << line << ": expected\n" << expected << "\nnot\n" << actual << "\n";
    ++failures;
  }
}

template<typename Action>
bool refuses(Action action)
{
  try {
    action();
  } catch (const std::length_error & error) {
    return std::string(error.what()) == "Exceeded upper bound";
  }
  return false;
}

/// An allocator that is no std::allocator, cannot be made from nothing, and counts.
template<typename T>
struct Counting
{
  using value_type = T;

  explicit Counting(int * counter)
  : count(counter)
  {
  }

  template<typename Other>
  Counting(const Counting<Other> & other)  // NOLINT(runtime/explicit)
  : count(other.count)
  {
  }

  T * allocate(std::size_t size)
  {
    ++*count;
    return std::allocator<T>().allocate(size);
  }

  void deallocate(T * pointer, std::size_t size)
  {
    std::allocator<T>().deallocate(pointer, size);
  }

  template<typename Other>
  bool operator==(const Counting<Other> & other) const
  {
    return count == other.count;
  }

  template<typename Other>
  bool operator!=(const Counting<Other> & other) const
  {
    return count != other.count;
  }

  int * count;
};

void types()
{
  using Plain = probe::msg::Plain;
  static_assert(std::is_same_v<Plain, probe::msg::Plain_<std::allocator<void>>>);
  static_assert(std::is_same_v<Plain::Type, Plain>);
  static_assert(std::is_same_v<decltype(Plain::flag), bool>);
  static_assert(std::is_same_v<decltype(Plain::octet), unsigned char>);
  static_assert(std::is_same_v<decltype(Plain::i64), int64_t>);
  static_assert(std::is_same_v<decltype(Plain::text), std::string>);
  static_assert(std::is_same_v<decltype(Plain::wide), std::u16string>);
  static_assert(std::is_same_v<decltype(Plain::three), std::array<int32_t, 3>>);
  static_assert(std::is_same_v<decltype(Plain::flags), std::vector<bool>>);
  static_assert(std::is_same_v<Plain::_words_type, std::vector<std::string>>);
  static_assert(
    std::is_same_v<decltype(Plain::some), rosidl_runtime_cpp::BoundedVector<int32_t, 4>>);
  static_assert(std::is_same_v<Plain::SharedPtr, std::shared_ptr<Plain>>);
  static_assert(std::is_same_v<Plain::ConstSharedPtr, std::shared_ptr<const Plain>>);
  static_assert(std::is_same_v<Plain::UniquePtr, std::unique_ptr<Plain>>);
  static_assert(std::is_same_v<Plain::WeakPtr, std::weak_ptr<Plain>>);
  static_assert(std::is_same_v<Plain::ConstWeakPtr, std::weak_ptr<const Plain>>);
  static_assert(std::is_same_v<Plain::RawPtr, Plain *>);
  static_assert(std::is_same_v<Plain::ConstRawPtr, const Plain *>);
  static_assert(
    std::is_same_v<Plain::ConstUniquePtr, std::unique_ptr<const Plain, std::default_delete<Plain>>>);
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
  static_assert(std::is_same_v<Plain::Ptr, Plain::SharedPtr>);
  static_assert(std::is_same_v<Plain::ConstPtr, Plain::ConstSharedPtr>);
#pragma GCC diagnostic pop
  static_assert(!std::is_convertible_v<MessageInitialization, Plain>, "constructors are explicit");
}

void constants()
{
  using probe::msg::Constants;
  static_assert(Constants::LOWEST == INT64_MIN);
  static_assert(Constants::HIGHEST == UINT64_MAX);
  static_assert(Constants::LOW == INT32_MIN);
  static_assert(Constants::YES);
  static_assert(std::is_same_v<decltype(Constants::OCTET), const unsigned char>);
  static_assert(Constants::OCTET == 255);
  static_assert(Constants::TENTH == 0.1f);
  static_assert(Constants::ENDLESS > 1e308);
  static_assert(Constants::NOTHING != Constants::NOTHING);
  static_assert(Constants::ERROR == 1 && Constants::DELETE == 2 && Constants::NO_ERROR == 3);
  const int8_t & by_reference = Constants::ERROR;
  HOLDS(by_reference == 1);
  HOLDS(Constants::QUOTED == "a \"b\" \\ c\n\tend?\?/");
  HOLDS(Constants::NAME == "caf\xc3\xa9 \xe6\x97\xa5");
  HOLDS(Constants::WIDE == u"caf\u00e9 \u65e5 \U0001f600");
  HOLDS(Constants::ZERO_INSIDE == std::string("a\0001", 3));
}

template<typename Message>
void check_zero(const Message & message)
{
  HOLDS(!message.flag && message.octet == 0 && message.i64 == 0 && message.single == 0.0f);
  HOLDS(message.text.empty() && message.wide.empty());
  HOLDS((message.three == std::array<int32_t, 3>{0, 0, 0}));
  HOLDS((message.pair == std::array<std::string, 2>{"", ""}));
  HOLDS(message.many.empty() && message.some.empty() && message.flags.empty());
}

void check_defaults(const probe::msg::Defaults & message)
{
  HOLDS(message.flag && message.octet == 255 && message.i64 == INT64_MIN);
  HOLDS(message.u64 == UINT64_MAX && message.i8 == -128);
  HOLDS(message.single == 0.1f && message.real == 0.1);
  HOLDS(message.text == "it's \"so\"" && message.wide == u"Hell\u00f6 w\u00f6rld!");
  HOLDS((message.three == std::array<int32_t, 3>{1, -2, INT32_MIN}));
  HOLDS((message.many == std::vector<int32_t>{7}));
  HOLDS((message.flags == std::vector<bool>{true, false}));
  HOLDS((message.pair == std::array<std::string, 2>{"a,b", "c"}));
  HOLDS((message.words == std::vector<std::string>{"x", "y"}));
  HOLDS(message.some.size() == 2 && message.some[1] == 6);
}

void initialization()
{
  using probe::msg::Defaults;
  check_defaults(Defaults());
  check_defaults(Defaults(MessageInitialization::ALL));
  check_defaults(Defaults(MessageInitialization::DEFAULTS_ONLY));
  check_defaults(Defaults(std::allocator<void>()));
  check_zero(Defaults(MessageInitialization::ZERO));
  check_zero(probe::msg::Plain());
  check_zero(probe::msg::Plain(MessageInitialization::ZERO));

  alignas(probe::msg::Plain) unsigned char memory[sizeof(probe::msg::Plain)];
  for (unsigned char & byte : memory) {
    byte = 0x5a;
  }
  auto * skipped = new (memory) probe::msg::Plain(MessageInitialization::DEFAULTS_ONLY);
  HOLDS(skipped->text.empty() && skipped->many.empty());
  skipped->~Plain_();

  using geometry_msgs::msg::Pose;
  HOLDS(Pose().orientation.w == 1.0);
  HOLDS(Pose(MessageInitialization::ZERO).orientation.w == 0.0);
  HOLDS(Pose(MessageInitialization::DEFAULTS_ONLY).orientation.w == 1.0);

  using probe::msg::Nest;
  HOLDS(Nest().fixed[1].i64 == INT64_MIN && Nest().one.flag);
  HOLDS(Nest(MessageInitialization::ZERO).fixed[1].i64 == 0);
  HOLDS(Nest(MessageInitialization::SKIP).fixed[1].i64 == INT64_MIN);
  HOLDS(Nest().any.empty() && Nest().few.empty());
}

void allocators()
{
  int count = 0;
  const Counting<void> allocator(&count);
  probe::msg::Strings_<Counting<void>> message(allocator);
  message.text = "a text that is too long to be kept inside the string object itself";
  message.words.emplace_back("short", allocator);
  HOLDS(count == 2);
  HOLDS(probe::msg::to_yaml(message, true).substr(0, 7) == "{text: ");

  using Allocated = probe::msg::Nest_<std::allocator<char>>;
  HOLDS(Allocated(std::allocator<char>(), MessageInitialization::ZERO).fixed[0].i64 == 0);
}

void setters_and_comparison()
{
  using geometry_msgs::msg::Point;
  Point point = Point().set__x(1.5).set__y(2).set__z(-3);
  HOLDS(point.x == 1.5 && point.y == 2.0 && point.z == -3.0);
  Point other = point;
  HOLDS(other == point && !(other != point));
  other.z = 0;
  HOLDS(other != point);
  HOLDS(probe::msg::Empty() == probe::msg::Empty());

  auto shared = std::make_shared<geometry_msgs::msg::PoseStamped>();
  shared->pose.position = point;
  geometry_msgs::msg::PoseStamped::ConstSharedPtr read_only = shared;
  geometry_msgs::msg::PoseStamped::UniquePtr unique(new geometry_msgs::msg::PoseStamped(*shared));
  HOLDS(*unique == *read_only);

  auto plain = probe::msg::Plain()
    .set__three({1, 2, 3}).set__words({"a", "b"}).set__flags({true}).set__some({1, 2});
  HOLDS(plain.words.size() == 2 && plain.flags[0] && plain.some.back() == 2);
}

void builders()
{
  const auto pose = geometry_msgs::build<geometry_msgs::msg::Pose>()
    .position(geometry_msgs::msg::Point().set__x(4))
    .orientation(geometry_msgs::msg::Quaternion());
  static_assert(std::is_same_v<decltype(pose), const geometry_msgs::msg::Pose>);
  HOLDS(pose.position.x == 4.0 && pose.orientation.w == 1.0);

  auto step = geometry_msgs::build<geometry_msgs::msg::Point>().x(1).y(2);
  HOLDS(step.z(3).z == 3.0);

  geometry_msgs::msg::builder::Init_Point_x start = geometry_msgs::build<geometry_msgs::msg::Point>();
  HOLDS(start.x(1).y(2).z(3).y == 2.0);

  const probe::msg::Empty empty = probe::build<probe::msg::Empty>();
  HOLDS(empty.structure_needs_at_least_one_member == 0);

  probe::msg::Names names = probe::msg::Names().set__std(1).set__uint8_t(2).set__geometry_msgs(3);
  HOLDS(names.std + names.uint8_t + names.geometry_msgs == 6);

  using Request = example_interfaces::srv::AddTwoInts::Request;
  HOLDS(example_interfaces::build<Request>().a(40).b(2).a == 40);
  HOLDS(builder::build<builder::srv::Ask::Request>().one(builder::msg::Inner()).one.x == 0);
  HOLDS(msg::msg::to_yaml(msg::msg::Outer(), true) == "{one: {x: 0}, all: []}");
}

void services_and_actions()
{
  using example_interfaces::srv::AddTwoInts;
  static_assert(std::is_same_v<AddTwoInts::Request, example_interfaces::srv::AddTwoInts_Request>);
  const auto request = std::make_shared<AddTwoInts::Request>();
  request->a = 1;
  AddTwoInts::Response response;
  response.sum = request->a + request->b;
  HOLDS(response.sum == 1);

  using example_interfaces::action::Fibonacci;
  Fibonacci::Goal goal;
  goal.order = 5;
  Fibonacci::Impl::SendGoalService::Request send;
  send.goal_id.uuid[15] = 7;
  send.goal = goal;
  Fibonacci::Impl::FeedbackMessage feedback;
  feedback.feedback.sequence = {0, 1, 1};
  Fibonacci::Impl::GetResultService::Response result;
  result.status = action_msgs::msg::GoalStatus::STATUS_SUCCEEDED;
  HOLDS(send.goal.order == 5 && result.status == 4 && feedback.feedback.sequence.size() == 3);
  static_assert(std::is_same_v<Fibonacci::Impl::CancelGoalService, action_msgs::srv::CancelGoal>);
  static_assert(
    std::is_same_v<Fibonacci::Impl::GoalStatusMessage, action_msgs::msg::GoalStatusArray>);
}

void facts()
{
  using example_interfaces::action::Fibonacci;
  using example_interfaces::srv::AddTwoInts;
  using geometry_msgs::msg::Pose;
  READS(traits::data_type<Pose>(), "geometry_msgs::msg::Pose");
  READS(traits::name<Pose>(), "geometry_msgs/msg/Pose");
  READS(traits::name<AddTwoInts>(), "example_interfaces/srv/AddTwoInts");
  READS(traits::data_type<AddTwoInts::Request>(), "example_interfaces::srv::AddTwoInts_Request");
  READS(traits::name<Fibonacci::Impl::SendGoalService>(), "example_interfaces/action/Fibonacci_SendGoal");
  static_assert(traits::is_message<Pose>::value && !traits::is_service<Pose>::value);
  static_assert(traits::is_message<AddTwoInts::Request>::value);
  static_assert(traits::is_service<AddTwoInts>::value && !traits::is_message<AddTwoInts>::value);
  static_assert(traits::is_service_request<AddTwoInts::Request>::value);
  static_assert(traits::is_service_response<AddTwoInts::Response>::value);
  static_assert(!traits::is_service_request<AddTwoInts::Response>::value);
  static_assert(traits::is_action<Fibonacci>::value && !traits::is_message<Fibonacci>::value);
  static_assert(traits::is_action_goal<Fibonacci::Goal>::value);
  static_assert(traits::is_action_result<Fibonacci::Result>::value);
  static_assert(traits::is_action_feedback<Fibonacci::Feedback>::value);
  static_assert(traits::is_service<Fibonacci::Impl::GetResultService>::value);

  static_assert(traits::has_fixed_size<Pose>::value && traits::has_bounded_size<Pose>::value);
  static_assert(traits::has_fixed_size<AddTwoInts>::value);
  static_assert(!traits::has_fixed_size<geometry_msgs::msg::PoseStamped>::value);
  static_assert(!traits::has_bounded_size<geometry_msgs::msg::PoseStamped>::value);
  static_assert(!traits::has_fixed_size<probe::msg::Bounded>::value);
  static_assert(traits::has_bounded_size<probe::msg::Bounded>::value);
  static_assert(traits::has_fixed_size<probe::msg::Empty>::value);
  static_assert(!traits::has_bounded_size<Fibonacci::Impl::FeedbackMessage>::value);
  static_assert(traits::has_fixed_size<Fibonacci::Impl::SendGoalService>::value);
  static_assert(!traits::is_message<int>::value && !traits::has_fixed_size<int>::value);
}

void yaml()
{
  probe::msg::Small small;
  small.octets = {1, 255};
  small.numbers = {1, 2};
  small.reals = {{0.1, 1e10}};
  small.names = {"a\"b\\c", "n\nl"};
  small.flags = {true, false};
  READS(
    probe::msg::to_yaml(small),
    "i8: -5\n"
    "u8: 200\n"
    "octet: 0x0a\n"
    "octets:\n- 0x01\n- 0xff\n"
    "numbers:\n- 1\n- 2\n"
    "none: []\n"
    "reals:\n- 0.100000\n- 1.00000e+10\n"
    "names:\n- \"a\\\"b\\\\c\"\n- \"n\nl\"\n"
    "flags:\n- true\n- false\n"
    "point:\n  x: 0.00000\n  y: 0.00000\n  z: 0.00000\n"
    "points: []\n");
  small.points.resize(2);
  small.points[1].y = 2.5;
  READS(
    to_yaml(small, true),
    "{i8: -5, u8: 200, octet: 0x0a, octets: [0x01, 0xff], numbers: [1, 2], none: [], "
    "reals: [0.100000, 1.00000e+10], names: [\"a\\\"b\\\\c\", \"n\nl\"], flags: [true, false], "
    "point: {x: 0.00000, y: 0.00000, z: 0.00000}, points: [{x: 0.00000, y: 0.00000, z: 0.00000}, "
    "{x: 0.00000, y: 2.50000, z: 0.00000}]}");

  std::ostringstream block;
  geometry_msgs::msg::to_block_style_yaml(small.points[1], block, 4);
  READS(block.str(), "    x: 0.00000\n    y: 2.50000\n    z: 0.00000\n");
  std::ostringstream flow;
  to_flow_style_yaml(geometry_msgs::msg::Point(), static_cast<std::ostream &>(flow));
  READS(flow.str(), "{x: 0.00000, y: 0.00000, z: 0.00000}");

  READS(probe::msg::to_yaml(probe::msg::Empty()), "null\n");
  READS(probe::msg::to_yaml(probe::msg::Empty(), true), "null");
  probe::msg::Nothings nothings;
  nothings.several.resize(1);
  READS(probe::msg::to_yaml(nothings), "one:\n  null\nseveral:\n-\n  null\n");
  READS(probe::msg::to_yaml(nothings, true), "{one: null, several: [null]}");

  probe::msg::Points points;
  points.items.resize(2);
  READS(
    probe::msg::to_yaml(points),
    "items:\n-\n  x: 0.00000\n  y: 0.00000\n  z: 0.00000\n"
    "-\n  x: 0.00000\n  y: 0.00000\n  z: 0.00000\n");

  probe::msg::Wide wide;
  wide.letter = u'\u00e9';
  wide.text = u"a\u00e9\u65e5\"";
  wide.letters = {u'a'};
  READS(
    probe::msg::to_yaml(wide),
    "letter: \"\\u00e9\"\nletters:\n- \"\\u0061\"\ntext: \"a\\xe9\\u65e5\"\"\n"
    "signs:\n- 0x00\n- 0x00\n");
  rosidl_runtime_cpp::YamlWriter writer(false);
  writer.scalar("precise", 0.5L);
  READS(writer.text(), "precise: 0.500000\n");

  probe::msg::HTTPServer server;
  server.high = UINT64_MAX;
  READS(to_yaml(server, true), "{low: -9223372036854775808, high: 18446744073709551615, bad: nan, far: -inf}");

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
  READS(traits::to_yaml(points.items[0]), "x: 0.00000\ny: 0.00000\nz: 0.00000\n");
  std::ostringstream old;
  traits::to_yaml(points.items[0], old, 1);
  READS(old.str(), " x: 0.00000\n y: 0.00000\n z: 0.00000\n");
#pragma GCC diagnostic pop
}

void bounded_vectors()
{
  using Vector = rosidl_runtime_cpp::BoundedVector<int, 3>;
  Vector vector{1, 2, 3};
  HOLDS(vector.size() == 3 && vector.max_size() == 3 && vector.data()[2] == 3);
  HOLDS(std::as_const(vector).data()[0] == 1 && vector.front() == 1 && vector.back() == 3);
  HOLDS(refuses([&] {vector.push_back(4);}));
  HOLDS(refuses([&] {vector.emplace_back(4);}));
  HOLDS(refuses([&] {vector.emplace(vector.begin(), 4);}));
  HOLDS(refuses([&] {vector.insert(vector.begin(), 4);}));
  HOLDS(refuses([&] {vector.insert(vector.begin(), 2, 4);}));
  HOLDS(refuses([&] {vector.insert(vector.begin(), {4});}));
  HOLDS(refuses([&] {vector.resize(4);}));
  HOLDS(refuses([&] {vector.resize(4, 0);}));
  HOLDS(refuses([&] {vector.reserve(4);}));
  HOLDS(refuses([&] {vector.assign(4, 0);}));
  HOLDS(refuses([&] {vector = {1, 2, 3, 4};}));
  HOLDS(refuses([&] {Vector four(4);}));
  HOLDS(refuses([&] {Vector four(4, 1);}));
  HOLDS((vector == Vector{1, 2, 3}));

  const std::list<int> list{7, 8, 9, 10};
  HOLDS(refuses([&] {vector.assign(list.begin(), list.end());}));
  HOLDS(refuses([&] {Vector four(list.begin(), list.end());}));
  HOLDS((vector == Vector{1, 2, 3}));
  vector.assign(list.begin(), std::next(list.begin(), 2));
  HOLDS((vector == Vector{7, 8}));
  std::istringstream once("4 5");
  vector.assign(std::istream_iterator<int>(once), std::istream_iterator<int>());
  HOLDS((vector == Vector{4, 5}));
  std::istringstream more("6 7");
  HOLDS(refuses([&] {
      vector.insert(
        vector.end(), std::istream_iterator<int>(more), std::istream_iterator<int>());
    }));
  vector.assign(2, 5);
  vector.insert(vector.begin(), list.begin(), std::next(list.begin()));
  HOLDS((vector == Vector{7, 5, 5}));
  vector.erase(vector.begin());
  vector.pop_back();
  HOLDS(vector.size() == 1 && vector < (Vector{6}) && vector != (Vector{6}));
  Vector other{1, 2};
  swap(vector, other);
  HOLDS(vector.size() == 2 && other.size() == 1 && other.at(0) == 5);
  int sum = 0;
  for (const int value : vector) {
    sum += value;
  }
  HOLDS(sum == 3);

  rosidl_runtime_cpp::BoundedVector<bool, 2> flags(2, true);
  flags[0] = false;
  HOLDS(!flags[0] && flags.back() && refuses([&] {flags.push_back(true);}));
  rosidl_runtime_cpp::BoundedVector<std::string, 2> words(2);
  words.insert(words.erase(words.begin()), std::string("w"));
  HOLDS(words[0] == "w" && words[1].empty());
}

void type_supports()
{
  using rosidl_typesupport_cpp::get_action_type_support_handle;
  using rosidl_typesupport_cpp::get_message_type_support_handle;
  using rosidl_typesupport_cpp::get_service_type_support_handle;
  const auto named = [](const auto * handle) {return std::string(static_cast<const char *>(handle->data));};

  const auto * message = get_message_type_support_handle<geometry_msgs::msg::Pose>();
  HOLDS(named(message) == "geometry_msgs/msg/Pose");
  HOLDS(message->typesupport_identifier == std::string(rosidl_typesupport_cpp::typesupport_identifier));
  HOLDS(message->func(message, rosidl_typesupport_cpp::typesupport_identifier) == message);
  HOLDS(message->func(message, "rosidl_typesupport_introspection_cpp") == nullptr);
  HOLDS(
    ROSIDL_TYPESUPPORT_INTERFACE__MESSAGE_SYMBOL_NAME(
      rosidl_typesupport_cpp, geometry_msgs, msg, Pose)() == message);

  const auto * service = get_service_type_support_handle<std_srvs::srv::Empty>();
  HOLDS(named(service) == "std_srvs/srv/Empty");
  HOLDS(service->func(service, service->typesupport_identifier) == service);

  using example_interfaces::action::Fibonacci;
  const auto * action = get_action_type_support_handle<Fibonacci>();
  HOLDS(action->goal_service_type_support == get_service_type_support_handle<Fibonacci::Impl::SendGoalService>());
  HOLDS(named(action->feedback_message_type_support) == "example_interfaces/action/Fibonacci_FeedbackMessage");
  HOLDS(named(action->status_message_type_support) == "action_msgs/msg/GoalStatusArray");
}

}  // namespace

template struct probe::msg::Defaults_<std::allocator<void>>;
template struct probe::msg::Plain_<std::allocator<void>>;
template struct probe::msg::Names_<std::allocator<void>>;
template struct probe::msg::Nest_<std::allocator<void>>;
template struct probe::msg::Constants_<std::allocator<void>>;
template struct probe::msg::Wide_<std::allocator<void>>;
template class rosidl_runtime_cpp::BoundedVector<int, 3>;
template class rosidl_runtime_cpp::BoundedVector<std::string, 3>;

int main()
{
  types();
  constants();
  initialization();
  allocators();
  setters_and_comparison();
  builders();
  services_and_actions();
  facts();
  yaml();
  bounded_vectors();
  type_supports();
  return failures;
}
