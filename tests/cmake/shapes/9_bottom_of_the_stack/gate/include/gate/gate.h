#ifndef GATE__GATE_H_
#define GATE__GATE_H_

#include "rosidl_runtime_c/string.h"
#include "text_tools/text_tools.h"

#ifdef __cplusplus
extern "C"
{
#endif

int gate_open(const char * word);

#ifdef __cplusplus
}
#endif

#endif  // GATE__GATE_H_
