#ifndef ROSIDL_RUNTIME_C__PRIMITIVES_SEQUENCE_FUNCTIONS_H_
#define ROSIDL_RUNTIME_C__PRIMITIVES_SEQUENCE_FUNCTIONS_H_

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "rosidl_runtime_c/primitives_sequence.h"

/* Defines, for sequences of a primitive type:
 *
 *   init       creates `size` zeros; returns false if memory runs out, without leaks
 *   fini       frees the memory; the sequence is empty afterwards
 *   are_equal  compares numbers with ==, so NaN is not equal to itself
 *   copy       allocates only if the capacity is insufficient; returns false if memory runs out, and leaves
 *              the output unchanged
 *
 * fini() and copy() accept initialized and zeroed sequences; fini() may be called twice. */
#define ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(NAME, TYPE) \
  static inline bool rosidl_runtime_c__ ## NAME ## __Sequence__init( \
    rosidl_runtime_c__ ## NAME ## __Sequence * sequence, size_t size) \
  { \
    if (!sequence) { \
      return false; \
    } \
    sequence->data = size ? (TYPE *)calloc(size, sizeof(TYPE)) : NULL; \
    sequence->size = sequence->data ? size : 0; \
    sequence->capacity = sequence->size; \
    return sequence->size == size; \
  } \
  \
  static inline void rosidl_runtime_c__ ## NAME ## __Sequence__fini( \
    rosidl_runtime_c__ ## NAME ## __Sequence * sequence) \
  { \
    if (!sequence) { \
      return; \
    } \
    free(sequence->data); \
    sequence->data = NULL; \
    sequence->size = 0; \
    sequence->capacity = 0; \
  } \
  \
  static inline bool rosidl_runtime_c__ ## NAME ## __Sequence__are_equal( \
    const rosidl_runtime_c__ ## NAME ## __Sequence * lhs, \
    const rosidl_runtime_c__ ## NAME ## __Sequence * rhs) \
  { \
    if (!lhs || !rhs || lhs->size != rhs->size) { \
      return false; \
    } \
    for (size_t i = 0; i < lhs->size; ++i) { \
      if (!(lhs->data[i] == rhs->data[i])) { \
        return false; \
      } \
    } \
    return true; \
  } \
  \
  static inline bool rosidl_runtime_c__ ## NAME ## __Sequence__copy( \
    const rosidl_runtime_c__ ## NAME ## __Sequence * input, \
    rosidl_runtime_c__ ## NAME ## __Sequence * output) \
  { \
    if (!input || !output) { \
      return false; \
    } \
    if (output->capacity < input->size) { \
      TYPE * data = (TYPE *)realloc(output->data, input->size * sizeof(TYPE)); \
      if (!data) { \
        return false; \
      } \
      output->data = data; \
      output->capacity = input->size; \
    } \
    if (input->size) { \
      memmove(output->data, input->data, input->size * sizeof(TYPE)); \
    } \
    output->size = input->size; \
    return true; \
  }

ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(boolean, bool)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(octet, uint8_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(char, signed char)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(wchar, uint16_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(int8, int8_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(uint8, uint8_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(int16, int16_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(uint16, uint16_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(int32, int32_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(uint32, uint32_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(int64, int64_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(uint64, uint64_t)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(float, float)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(double, double)
ROSIDL_RUNTIME_C__PRIMITIVE_SEQUENCE_FUNCTIONS(long_double, long double)

/* Aliases of the functions with older names. */
#define rosidl_runtime_c__bool__Sequence__init rosidl_runtime_c__boolean__Sequence__init
#define rosidl_runtime_c__bool__Sequence__fini rosidl_runtime_c__boolean__Sequence__fini
#define rosidl_runtime_c__bool__Sequence__are_equal rosidl_runtime_c__boolean__Sequence__are_equal
#define rosidl_runtime_c__bool__Sequence__copy rosidl_runtime_c__boolean__Sequence__copy
#define rosidl_runtime_c__byte__Sequence__init rosidl_runtime_c__octet__Sequence__init
#define rosidl_runtime_c__byte__Sequence__fini rosidl_runtime_c__octet__Sequence__fini
#define rosidl_runtime_c__byte__Sequence__are_equal rosidl_runtime_c__octet__Sequence__are_equal
#define rosidl_runtime_c__byte__Sequence__copy rosidl_runtime_c__octet__Sequence__copy
#define rosidl_runtime_c__float32__Sequence__init rosidl_runtime_c__float__Sequence__init
#define rosidl_runtime_c__float32__Sequence__fini rosidl_runtime_c__float__Sequence__fini
#define rosidl_runtime_c__float32__Sequence__are_equal rosidl_runtime_c__float__Sequence__are_equal
#define rosidl_runtime_c__float32__Sequence__copy rosidl_runtime_c__float__Sequence__copy
#define rosidl_runtime_c__float64__Sequence__init rosidl_runtime_c__double__Sequence__init
#define rosidl_runtime_c__float64__Sequence__fini rosidl_runtime_c__double__Sequence__fini
#define rosidl_runtime_c__float64__Sequence__are_equal rosidl_runtime_c__double__Sequence__are_equal
#define rosidl_runtime_c__float64__Sequence__copy rosidl_runtime_c__double__Sequence__copy

#endif  /* ROSIDL_RUNTIME_C__PRIMITIVES_SEQUENCE_FUNCTIONS_H_ */
