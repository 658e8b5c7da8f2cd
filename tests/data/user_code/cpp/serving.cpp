// Services: handlers get shared pointers to a request and a response.

#include <cassert>
#include <functional>
#include <memory>

#include "example_interfaces/srv/add_two_ints.hpp"
#include "rover/srv/plan.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace serving
{

using example_interfaces::srv::AddTwoInts;
using std::placeholders::_1;
using std::placeholders::_2;

template<typename ServiceT>
class Server
{
public:
  using Handler = std::function<void (
        std::shared_ptr<typename ServiceT::Request>, std::shared_ptr<typename ServiceT::Response>)>;

  explicit Server(Handler handler)
  : handler_(std::move(handler)) {}

  typename ServiceT::Response::SharedPtr call(typename ServiceT::Request::SharedPtr request) const
  {
    auto response = std::make_shared<typename ServiceT::Response>();
    handler_(request, response);
    return response;
  }

private:
  Handler handler_;
};

void add(const std::shared_ptr<AddTwoInts::Request> request, std::shared_ptr<AddTwoInts::Response> response)
{
  response->sum = request->a + request->b;
}

class Planner
{
public:
  Planner()
  : server(std::bind(&Planner::plan, this, _1, _2)) {}

private:
  void plan(const rover::srv::Plan::Request::SharedPtr request, rover::srv::Plan::Response::SharedPtr response)
  {
    using Response = rover::srv::Plan::Response;
    response->code = request->clearance > limit_ ? Response::BLOCKED : Response::OK;
    response->route.waypoints.resize(1);
    response->route.waypoints.front().position = request->target;
  }

  double limit_ = 1.0;

public:
  Server<rover::srv::Plan> server;
};

void run()
{
  auto request = std::make_shared<AddTwoInts::Request>();
  request->a = 41;
  request->b = 1;
  assert(Server<AddTwoInts>(&add).call(request)->sum == 42);

  const Planner planner;
  auto question = std::make_shared<rover::srv::Plan::Request>();
  assert(question->clearance == 0.3);
  question->target.x = 7.0;
  const auto answer = planner.server.call(question);
  assert(answer->code == rover::srv::Plan::Response::OK);
  assert(answer->route.waypoints[0].position.x == 7.0);

  const auto done = std_srvs::srv::Trigger::Response().set__success(true).set__message("done");
  assert(done.success && std_srvs::srv::Trigger::Request() == std_srvs::srv::Trigger::Request());
}

}  // namespace serving
