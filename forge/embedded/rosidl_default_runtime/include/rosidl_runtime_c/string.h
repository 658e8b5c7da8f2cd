#ifndef ROSIDL_RUNTIME_C__STRING_H_
#define ROSIDL_RUNTIME_C__STRING_H_

#include <stddef.h>

/* A string of `size` bytes and a NUL, with memory for `capacity` bytes. A zeroed struct is an empty string. */
typedef struct rosidl_runtime_c__String
{
  char * data;
  size_t size;
  size_t capacity;
} rosidl_runtime_c__String;

/* `size` strings, with memory for `capacity` strings, all of which are initialized. */
typedef struct rosidl_runtime_c__String__Sequence
{
  rosidl_runtime_c__String * data;
  size_t size;
  size_t capacity;
} rosidl_runtime_c__String__Sequence;

#endif  /* ROSIDL_RUNTIME_C__STRING_H_ */
