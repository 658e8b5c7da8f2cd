#ifndef TEXT_TOOLS__TEXT_TOOLS_H_
#define TEXT_TOOLS__TEXT_TOOLS_H_

#include <stddef.h>

#include "text_tools/words.h"

#ifdef __cplusplus
extern "C"
{
#endif

void text_tools_upper(char * text, size_t length);

#ifdef __cplusplus
}
#endif

#endif  // TEXT_TOOLS__TEXT_TOOLS_H_
