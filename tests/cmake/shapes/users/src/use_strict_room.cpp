#include "strict_room/srv/knock.hpp"

int main()
{
  strict_room::srv::Knock::Request request;
  return request.who.name == "anna" ? 0 : 1;
}
