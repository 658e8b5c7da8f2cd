#ifndef ROSIDL_RUNTIME_C__U16STRING_FUNCTIONS_H_
#define ROSIDL_RUNTIME_C__U16STRING_FUNCTIONS_H_

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "rosidl_runtime_c/sequence_functions.h"
#include "rosidl_runtime_c/u16string.h"

/* Functions return false if memory runs out or an argument is NULL.
 * Sizes are in UTF-16 code units, not bytes. */

/* Initialize an empty string. */
static inline bool rosidl_runtime_c__U16String__init(rosidl_runtime_c__U16String * str)
{
  if (!str) {
    return false;
  }
  str->size = 0;
  str->data = (uint_least16_t *)calloc(1, sizeof(*str->data));
  str->capacity = str->data ? 1 : 0;
  return str->data != NULL;
}

/* Free the memory. The string can be assigned to afterwards. */
static inline void rosidl_runtime_c__U16String__fini(rosidl_runtime_c__U16String * str)
{
  if (!str) {
    return;
  }
  free(str->data);
  str->data = NULL;
  str->size = 0;
  str->capacity = 0;
}

/* Assign the `n` code units at `value`, which may be a part of the string itself. The memory is reused if it is
 * large enough; an empty value releases it. */
static inline bool rosidl_runtime_c__U16String__assignn(
  rosidl_runtime_c__U16String * str, const uint_least16_t * value, size_t n)
{
  if (!str || !value || n >= SIZE_MAX / sizeof(*value)) {
    return false;
  }
  if (n < str->capacity && (n || str->capacity == 1)) {
    memmove(str->data, value, n * sizeof(*value));
  } else {
    uint_least16_t * data = (uint_least16_t *)malloc((n + 1) * sizeof(*value));
    if (!data) {
      return false;
    }
    memcpy(data, value, n * sizeof(*value));
    free(str->data);
    str->data = data;
    str->capacity = n + 1;
  }
  str->data[n] = 0;
  str->size = n;
  return true;
}

/* Assign the `n` bytes at `value`; `n` is even, and `value` may be unaligned. */
static inline bool rosidl_runtime_c__U16String__assignn_from_char(
  rosidl_runtime_c__U16String * str, const char * value, size_t n)
{
  if (!str || !value || n % sizeof(*str->data) != 0) {
    return false;
  }
  uint_least16_t * data = (uint_least16_t *)malloc(n + sizeof(*data));
  if (!data) {
    return false;
  }
  memcpy(data, value, n);
  free(str->data);
  str->data = data;
  str->size = n / sizeof(*data);
  str->capacity = str->size + 1;
  str->data[str->size] = 0;
  return true;
}

/* Return the number of code units before the zero; 0 for NULL. */
static inline size_t rosidl_runtime_c__U16String__len(const uint_least16_t * value)
{
  size_t size = 0;
  while (value && value[size]) {
    ++size;
  }
  return size;
}

/* Assign `value`, up to its zero. */
static inline bool rosidl_runtime_c__U16String__assign(
  rosidl_runtime_c__U16String * str, const uint_least16_t * value)
{
  return rosidl_runtime_c__U16String__assignn(str, value, rosidl_runtime_c__U16String__len(value));
}

/* Truncate the string to `n` code units, or extend it with zeros. */
static inline bool rosidl_runtime_c__U16String__resize(rosidl_runtime_c__U16String * str, size_t n)
{
  if (!str || n >= SIZE_MAX / sizeof(*str->data)) {
    return false;
  }
  if (n >= str->capacity) {
    uint_least16_t * data = (uint_least16_t *)realloc(str->data, (n + 1) * sizeof(*data));
    if (!data) {
      return false;
    }
    str->data = data;
    str->capacity = n + 1;
  }
  for (size_t i = str->size; i < n; ++i) {
    str->data[i] = 0;
  }
  str->data[n] = 0;
  str->size = n;
  return true;
}

static inline bool rosidl_runtime_c__U16String__are_equal(
  const rosidl_runtime_c__U16String * lhs, const rosidl_runtime_c__U16String * rhs)
{
  if (!lhs || !rhs || lhs->size != rhs->size) {
    return false;
  }
  return lhs->size == 0 || memcmp(lhs->data, rhs->data, lhs->size * sizeof(*lhs->data)) == 0;
}

static inline bool rosidl_runtime_c__U16String__copy(
  const rosidl_runtime_c__U16String * input, rosidl_runtime_c__U16String * output)
{
  static const uint_least16_t nothing = 0;
  if (!input) {
    return false;
  }
  return rosidl_runtime_c__U16String__assignn(output, input->data ? input->data : &nothing, input->size);
}

ROSIDL_RUNTIME_C__SEQUENCE_FUNCTIONS(rosidl_runtime_c__U16String)

#endif  /* ROSIDL_RUNTIME_C__U16STRING_FUNCTIONS_H_ */
