#ifndef ROSIDL_RUNTIME_C__STRING_H_
#define ROSIDL_RUNTIME_C__STRING_H_

#include <stddef.h>

/* A text of `size` bytes, then a NUL, in memory for `capacity` bytes. All zero is a text, too: an empty one. */
typedef struct rosidl_runtime_c__String
{
  char * data;
  size_t size;
  size_t capacity;
} rosidl_runtime_c__String;

/* `size` texts, in memory for `capacity`, of which every one is initialized. */
typedef struct rosidl_runtime_c__String__Sequence
{
  rosidl_runtime_c__String * data;
  size_t size;
  size_t capacity;
} rosidl_runtime_c__String__Sequence;

#endif  /* ROSIDL_RUNTIME_C__STRING_H_ */
