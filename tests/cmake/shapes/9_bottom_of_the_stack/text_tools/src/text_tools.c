#include "text_tools/text_tools.h"

#include <ctype.h>

void text_tools_upper(char * text, size_t length)
{
  for (size_t i = 0; i < length; ++i) {
    text[i] = (char)toupper((unsigned char)text[i]);
  }
}
