#include "gate/gate.h"

int main()
{
  return gate_open("hello") == 1 ? 0 : 1;
}
