#include <strict_room/action/visit.hpp>
#include <strict_room/msg/guest.hpp>
#include <strict_room/srv/knock.hpp>

int main()
{
  strict_room::srv::Knock::Request request;
  request.who.seen.emplace_back();
  strict_room::action::Visit::Goal goal;
  goal.who = request.who;
  return goal.who.name == "anna" && goal.who.seen.size() == 1 ? 0 : 1;
}
