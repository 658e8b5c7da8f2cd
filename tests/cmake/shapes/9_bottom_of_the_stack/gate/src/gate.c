#include "gate/gate.h"

#include <string.h>

#ifndef GATE_IN_C
#error "configure_gate_library() was not called"
#endif

int gate_open(const char * word)
{
  char text[8] = {0};
  strncpy(text, word, sizeof(text) - 1);
  text_tools_upper(text, strlen(text));
  return strcmp(text, "HELLO") == 0;
}
