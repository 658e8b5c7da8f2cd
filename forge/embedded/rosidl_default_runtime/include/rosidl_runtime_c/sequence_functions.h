#ifndef ROSIDL_RUNTIME_C__SEQUENCE_FUNCTIONS_H_
#define ROSIDL_RUNTIME_C__SEQUENCE_FUNCTIONS_H_

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

/* Defines the functions of TYPE__Sequence from those of TYPE:
 *
 *   bool TYPE__Sequence__init(TYPE__Sequence *, size_t size)       creates `size` initialized elements
 *   void TYPE__Sequence__fini(TYPE__Sequence *)                    frees all memory; empty afterwards
 *   TYPE__Sequence * TYPE__Sequence__create(size_t size)           allocates one; NULL if memory runs out
 *   void TYPE__Sequence__destroy(TYPE__Sequence *)                 frees one of create(), or NULL
 *   bool TYPE__Sequence__are_equal(const TYPE__Sequence *, const TYPE__Sequence *)
 *   bool TYPE__Sequence__copy(const TYPE__Sequence * input, TYPE__Sequence * output)
 *
 * fini() and copy() accept initialized and zeroed sequences; fini() may be called twice. Elements between size
 * and capacity stay initialized, so a shorter copy allocates nothing. If memory runs out, functions return
 * false: init() then leaks nothing, and copy() leaves a valid sequence that differs from its input. */
#define ROSIDL_RUNTIME_C__SEQUENCE_FUNCTIONS(TYPE) \
  static inline void TYPE ## __Sequence__fini(TYPE ## __Sequence * sequence) \
  { \
    if (!sequence) { \
      return; \
    } \
    if (sequence->data) { \
      for (size_t i = 0; i < sequence->capacity; ++i) { \
        TYPE ## __fini(&sequence->data[i]); \
      } \
      free(sequence->data); \
    } \
    sequence->data = NULL; \
    sequence->size = 0; \
    sequence->capacity = 0; \
  } \
  \
  /* Allocate memory for `size` elements and initialize the new ones. */ \
  static inline bool TYPE ## __Sequence__grow(TYPE ## __Sequence * sequence, size_t size) \
  { \
    if (size <= sequence->capacity) { \
      return true; \
    } \
    if (size > SIZE_MAX / sizeof(TYPE)) { \
      return false; \
    } \
    TYPE * data = (TYPE *)realloc(sequence->data, size * sizeof(TYPE)); \
    if (!data) { \
      return false; \
    } \
    sequence->data = data; \
    for (; sequence->capacity < size; ++sequence->capacity) { \
      if (!TYPE ## __init(&data[sequence->capacity])) { \
        return false; \
      } \
    } \
    return true; \
  } \
  \
  static inline bool TYPE ## __Sequence__init(TYPE ## __Sequence * sequence, size_t size) \
  { \
    if (!sequence) { \
      return false; \
    } \
    sequence->data = NULL; \
    sequence->size = 0; \
    sequence->capacity = 0; \
    if (!TYPE ## __Sequence__grow(sequence, size)) { \
      TYPE ## __Sequence__fini(sequence); \
      return false; \
    } \
    sequence->size = size; \
    return true; \
  } \
  \
  static inline TYPE ## __Sequence * TYPE ## __Sequence__create(size_t size) \
  { \
    TYPE ## __Sequence * sequence = (TYPE ## __Sequence *)malloc(sizeof(*sequence)); \
    if (!TYPE ## __Sequence__init(sequence, size)) { \
      free(sequence); \
      return NULL; \
    } \
    return sequence; \
  } \
  \
  static inline void TYPE ## __Sequence__destroy(TYPE ## __Sequence * sequence) \
  { \
    TYPE ## __Sequence__fini(sequence); \
    free(sequence); \
  } \
  \
  static inline bool TYPE ## __Sequence__are_equal( \
    const TYPE ## __Sequence * lhs, const TYPE ## __Sequence * rhs) \
  { \
    if (!lhs || !rhs || lhs->size != rhs->size) { \
      return false; \
    } \
    for (size_t i = 0; i < lhs->size; ++i) { \
      if (!TYPE ## __are_equal(&lhs->data[i], &rhs->data[i])) { \
        return false; \
      } \
    } \
    return true; \
  } \
  \
  static inline bool TYPE ## __Sequence__copy( \
    const TYPE ## __Sequence * input, TYPE ## __Sequence * output) \
  { \
    if (!input || !output || !TYPE ## __Sequence__grow(output, input->size)) { \
      return false; \
    } \
    output->size = input->size; \
    for (size_t i = 0; i < input->size; ++i) { \
      if (!TYPE ## __copy(&input->data[i], &output->data[i])) { \
        return false; \
      } \
    } \
    return true; \
  }

#endif  /* ROSIDL_RUNTIME_C__SEQUENCE_FUNCTIONS_H_ */
