// A publisher and a subscriber that meet in one process; callbacks take messages by every pointer there is.

#include <cassert>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "std_msgs/msg/string.hpp"

namespace talking
{

using std::placeholders::_1;

template<typename MessageT>
class Topic
{
public:
  using Callback = std::function<void (std::shared_ptr<const MessageT>)>;

  void subscribe(Callback callback)
  {
    callbacks_.push_back(std::move(callback));
  }

  void publish(typename MessageT::UniquePtr message)
  {
    typename MessageT::ConstSharedPtr shared = std::move(message);
    for (const auto & callback : callbacks_) {
      callback(shared);
    }
  }

  void publish(const MessageT & message)
  {
    publish(std::make_unique<MessageT>(message));
  }

private:
  std::vector<Callback> callbacks_;
};

class Listener
{
public:
  explicit Listener(Topic<std_msgs::msg::String> & topic)
  {
    topic.subscribe(std::bind(&Listener::on_text, this, _1));
    topic.subscribe([this](std_msgs::msg::String::ConstSharedPtr message) {last = message->data;});
  }

  std::vector<std::string> heard;
  std::string last;

private:
  void on_text(const std_msgs::msg::String::ConstSharedPtr message)
  {
    heard.push_back("I heard: '" + message->data + "'");
  }
};

void run()
{
  Topic<std_msgs::msg::String> topic;
  Listener listener(topic);
  auto message = std_msgs::msg::String();
  for (int count = 0; count < 2; ++count) {
    message.data = "Hello, world! " + std::to_string(count);
    topic.publish(message);
  }
  auto last = std::make_unique<std_msgs::msg::String>();
  last->data = "bye";
  topic.publish(std::move(last));
  assert(listener.heard.size() == 3);
  assert(listener.heard[1] == "I heard: 'Hello, world! 1'");
  assert(listener.last == "bye");
}

}  // namespace talking
