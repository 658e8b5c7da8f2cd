#ifndef ROSIDL_RUNTIME_C__STRING_FUNCTIONS_H_
#define ROSIDL_RUNTIME_C__STRING_FUNCTIONS_H_

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "rosidl_runtime_c/sequence_functions.h"
#include "rosidl_runtime_c/string.h"

/* Functions return false if memory runs out or an argument is NULL. */

/* Initialize an empty string. */
static inline bool rosidl_runtime_c__String__init(rosidl_runtime_c__String * str)
{
  if (!str) {
    return false;
  }
  str->size = 0;
  str->data = (char *)calloc(1, 1);
  str->capacity = str->data ? 1 : 0;
  return str->data != NULL;
}

/* Free the memory. The string can be assigned to afterwards. */
static inline void rosidl_runtime_c__String__fini(rosidl_runtime_c__String * str)
{
  if (!str) {
    return;
  }
  free(str->data);
  str->data = NULL;
  str->size = 0;
  str->capacity = 0;
}

/* Assign the `n` bytes at `value`, which may be a part of the string itself. The memory is reused if it is large
 * enough; an empty value releases it. */
static inline bool rosidl_runtime_c__String__assignn(
  rosidl_runtime_c__String * str, const char * value, size_t n)
{
  if (!str || !value || n == SIZE_MAX) {
    return false;
  }
  if (n < str->capacity && (n || str->capacity == 1)) {
    memmove(str->data, value, n);
  } else {
    char * data = (char *)malloc(n + 1);
    if (!data) {
      return false;
    }
    memcpy(data, value, n);
    free(str->data);
    str->data = data;
    str->capacity = n + 1;
  }
  str->data[n] = '\0';
  str->size = n;
  return true;
}

/* Assign `value`, up to its NUL. */
static inline bool rosidl_runtime_c__String__assign(rosidl_runtime_c__String * str, const char * value)
{
  return value && rosidl_runtime_c__String__assignn(str, value, strlen(value));
}

/* Truncate the string to `n` bytes, or extend it with zeros. */
static inline bool rosidl_runtime_c__String__resize(rosidl_runtime_c__String * str, size_t n)
{
  if (!str || n == SIZE_MAX) {
    return false;
  }
  if (n >= str->capacity) {
    char * data = (char *)realloc(str->data, n + 1);
    if (!data) {
      return false;
    }
    str->data = data;
    str->capacity = n + 1;
  }
  if (n > str->size) {
    memset(str->data + str->size, 0, n - str->size);
  }
  str->data[n] = '\0';
  str->size = n;
  return true;
}

static inline bool rosidl_runtime_c__String__are_equal(
  const rosidl_runtime_c__String * lhs, const rosidl_runtime_c__String * rhs)
{
  if (!lhs || !rhs || lhs->size != rhs->size) {
    return false;
  }
  return lhs->size == 0 || memcmp(lhs->data, rhs->data, lhs->size) == 0;
}

static inline bool rosidl_runtime_c__String__copy(
  const rosidl_runtime_c__String * input, rosidl_runtime_c__String * output)
{
  if (!input) {
    return false;
  }
  return rosidl_runtime_c__String__assignn(output, input->data ? input->data : "", input->size);
}

ROSIDL_RUNTIME_C__SEQUENCE_FUNCTIONS(rosidl_runtime_c__String)

#endif  /* ROSIDL_RUNTIME_C__STRING_FUNCTIONS_H_ */
