#include <string.h>

#include "strict_room/action/visit.h"
#include "strict_room/msg/guest.h"

int main(void)
{
  strict_room__msg__Guest guest;
  if (!strict_room__msg__Guest__init(&guest)) {
    return 1;
  }
  int wrong = strcmp(guest.name.data, "anna");
  strict_room__msg__Guest__fini(&guest);
  return wrong != 0;
}
