#ifndef ROSIDL_RUNTIME_C__U16STRING_H_
#define ROSIDL_RUNTIME_C__U16STRING_H_

#include <stddef.h>
#include <stdint.h>

/* A string of `size` UTF-16 code units and a zero, with memory for `capacity` units. */
typedef struct rosidl_runtime_c__U16String
{
  uint_least16_t * data;
  size_t size;
  size_t capacity;
} rosidl_runtime_c__U16String;

/* `size` strings, with memory for `capacity` strings, all of which are initialized. */
typedef struct rosidl_runtime_c__U16String__Sequence
{
  rosidl_runtime_c__U16String * data;
  size_t size;
  size_t capacity;
} rosidl_runtime_c__U16String__Sequence;

#endif  /* ROSIDL_RUNTIME_C__U16STRING_H_ */
