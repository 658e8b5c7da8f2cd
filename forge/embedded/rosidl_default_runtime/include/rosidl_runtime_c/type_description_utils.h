#ifndef ROSIDL_RUNTIME_C__TYPE_DESCRIPTION_UTILS_H_
#define ROSIDL_RUNTIME_C__TYPE_DESCRIPTION_UTILS_H_

#include "rosidl_runtime_c/detail/type_description.h"

/* The functions return codes and hash maps of rcutils, so they are available where rcutils is. */
#ifdef __has_include
#if __has_include("rcutils/types/hash_map.h") && __has_include("rcutils/repl_str.h")
#include "rosidl_runtime_c/detail/type_description_rcutils.h"
#endif
#endif

#endif  /* ROSIDL_RUNTIME_C__TYPE_DESCRIPTION_UTILS_H_ */
