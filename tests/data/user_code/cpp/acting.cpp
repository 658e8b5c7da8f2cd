// Actions: a goal comes in, feedback goes out on the way, a result at the end.

#include <algorithm>
#include <cassert>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "example_interfaces/action/fibonacci.hpp"
#include "rover/action/drive.hpp"

namespace acting
{

template<typename ActionT>
class GoalHandle
{
public:
  explicit GoalHandle(typename ActionT::Goal goal)
  : goal_(std::make_shared<const typename ActionT::Goal>(std::move(goal))) {}

  std::shared_ptr<const typename ActionT::Goal> get_goal() const
  {
    return goal_;
  }

  void publish_feedback(std::shared_ptr<typename ActionT::Feedback> feedback)
  {
    typename ActionT::Impl::FeedbackMessage message;
    message.goal_id.uuid.fill(7);
    message.feedback = *feedback;
    published.push_back(std::move(message));
  }

  std::vector<typename ActionT::Impl::FeedbackMessage> published;

private:
  std::shared_ptr<const typename ActionT::Goal> goal_;
};

using Fibonacci = example_interfaces::action::Fibonacci;

Fibonacci::Result::SharedPtr execute(const std::shared_ptr<GoalHandle<Fibonacci>> handle)
{
  const auto goal = handle->get_goal();
  auto feedback = std::make_shared<Fibonacci::Feedback>();
  auto & sequence = feedback->sequence;
  sequence.push_back(0);
  sequence.push_back(1);
  auto result = std::make_shared<Fibonacci::Result>();
  for (std::size_t i = 1; i < static_cast<std::size_t>(goal->order); ++i) {
    sequence.push_back(sequence[i] + sequence[i - 1]);
    handle->publish_feedback(feedback);
  }
  result->sequence = sequence;
  return result;
}

void run()
{
  Fibonacci::Goal goal;
  goal.order = 5;
  auto handle = std::make_shared<GoalHandle<Fibonacci>>(goal);
  const auto result = execute(handle);
  const std::vector<int32_t> expected = {0, 1, 1, 2, 3, 5};
  assert(result->sequence == expected);
  assert(handle->published.size() == 4 && handle->published[0].feedback.sequence.size() == 3);

  using Send = Fibonacci::Impl::SendGoalService;
  Send::Request request;
  std::copy_n("0123456789abcdef", 16, request.goal_id.uuid.begin());
  request.goal = goal;
  assert(request.goal.order == 5 && request.goal_id.uuid[15] == 'f');
  Send::Response response;
  response.accepted = true;
  assert(response.stamp.sec == 0 && response.accepted);

  static_assert(std::is_same_v<Fibonacci::Impl::CancelGoalService, action_msgs::srv::CancelGoal>);
  static_assert(std::is_same_v<Fibonacci::Impl::GoalStatusMessage, action_msgs::msg::GoalStatusArray>);
  Fibonacci::Impl::GetResultService::Response finished;
  finished.status = action_msgs::msg::GoalStatus::STATUS_SUCCEEDED;
  assert(finished.status == 4 && finished.result.sequence.empty());

  rover::action::Drive::Feedback feedback;
  feedback.set__passed(2).next.name = "barn";
  assert(feedback.passed == 2u && feedback.next.speed == 0.5);
}

}  // namespace acting
