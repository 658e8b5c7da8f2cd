#ifndef ROSIDL_RUNTIME_C__U16STRING_H_
#define ROSIDL_RUNTIME_C__U16STRING_H_

#include <stddef.h>
#include <stdint.h>

/* A text of `size` units of UTF-16, then a zero, in memory for `capacity` units. */
typedef struct rosidl_runtime_c__U16String
{
  uint_least16_t * data;
  size_t size;
  size_t capacity;
} rosidl_runtime_c__U16String;

/* `size` texts, in memory for `capacity`, of which every one is initialized. */
typedef struct rosidl_runtime_c__U16String__Sequence
{
  rosidl_runtime_c__U16String * data;
  size_t size;
  size_t capacity;
} rosidl_runtime_c__U16String__Sequence;

#endif  /* ROSIDL_RUNTIME_C__U16STRING_H_ */
