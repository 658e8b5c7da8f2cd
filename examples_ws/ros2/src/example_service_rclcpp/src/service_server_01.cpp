// Add two numbers for whoever asks.

#include <cinttypes>
#include <memory>

#include "example_interfaces/srv/add_two_ints.hpp"
#include "rclcpp/rclcpp.hpp"

using example_interfaces::srv::AddTwoInts;

class ServiceServer01 : public rclcpp::Node
{
public:
  ServiceServer01()
  : Node("service_server_01")
  {
    service_ = create_service<AddTwoInts>(
      "add_two_ints_srv",
      [this](
        const std::shared_ptr<AddTwoInts::Request> request,
        const std::shared_ptr<AddTwoInts::Response> response) {add(*request, *response);});
  }

private:
  void add(const AddTwoInts::Request & request, AddTwoInts::Response & response)
  {
    response.sum = request.a + request.b;
    // PRId64 is the format of int64_t, whichever type that is on this machine.
    RCLCPP_INFO(
      get_logger(), "asked for %" PRId64 " + %" PRId64 ", answering %" PRId64,
      request.a, request.b, response.sum);
  }

  rclcpp::Service<AddTwoInts>::SharedPtr service_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<ServiceServer01>());
  rclcpp::shutdown();
  return 0;
}
