#ifndef ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_H_
#define ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_H_

/* The messages of type_description_interfaces for programs that must not depend on that package. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "rosidl_runtime_c/sequence_functions.h"
#include "rosidl_runtime_c/string.h"
#include "rosidl_runtime_c/string_functions.h"

#ifdef __cplusplus
extern "C"
{
#endif

/* Members of each message: numbers, strings and messages, sequences. */
#define FORGE_TD_FIELD_TYPE(NUMBER, OBJECT, SEQUENCE) \
  NUMBER(uint8_t, type_id) \
  NUMBER(uint64_t, capacity) \
  NUMBER(uint64_t, string_capacity) \
  OBJECT(rosidl_runtime_c__String, nested_type_name)

#define FORGE_TD_FIELD(NUMBER, OBJECT, SEQUENCE) \
  OBJECT(rosidl_runtime_c__String, name) \
  OBJECT(rosidl_runtime_c__type_description__FieldType, type) \
  OBJECT(rosidl_runtime_c__String, default_value)

#define FORGE_TD_INDIVIDUAL_TYPE_DESCRIPTION(NUMBER, OBJECT, SEQUENCE) \
  OBJECT(rosidl_runtime_c__String, type_name) \
  SEQUENCE(rosidl_runtime_c__type_description__Field, fields)

#define FORGE_TD_TYPE_DESCRIPTION(NUMBER, OBJECT, SEQUENCE) \
  OBJECT(rosidl_runtime_c__type_description__IndividualTypeDescription, type_description) \
  SEQUENCE( \
    rosidl_runtime_c__type_description__IndividualTypeDescription, referenced_type_descriptions)

#define FORGE_TD_TYPE_SOURCE(NUMBER, OBJECT, SEQUENCE) \
  OBJECT(rosidl_runtime_c__String, type_name) \
  OBJECT(rosidl_runtime_c__String, encoding) \
  OBJECT(rosidl_runtime_c__String, raw_file_contents)

#define FORGE_TD_KEY_VALUE(NUMBER, OBJECT, SEQUENCE) \
  OBJECT(rosidl_runtime_c__String, key) \
  OBJECT(rosidl_runtime_c__String, value)

/* What the functions below do with a member. */
#define FORGE_TD_NOTHING(TYPE, MEMBER)
#define FORGE_TD_DECLARE(TYPE, MEMBER) TYPE MEMBER;
#define FORGE_TD_DECLARE_SEQUENCE(TYPE, MEMBER) TYPE ## __Sequence MEMBER;
#define FORGE_TD_INIT(TYPE, MEMBER) done = done && TYPE ## __init(&message->MEMBER);
#define FORGE_TD_FINI(TYPE, MEMBER) TYPE ## __fini(&message->MEMBER);
#define FORGE_TD_FINI_SEQUENCE(TYPE, MEMBER) TYPE ## __Sequence__fini(&message->MEMBER);
#define FORGE_TD_EQUAL_NUMBER(TYPE, MEMBER) equal = equal && lhs->MEMBER == rhs->MEMBER;
#define FORGE_TD_EQUAL(TYPE, MEMBER) equal = equal && TYPE ## __are_equal(&lhs->MEMBER, &rhs->MEMBER);
#define FORGE_TD_EQUAL_SEQUENCE(TYPE, MEMBER) \
  equal = equal && TYPE ## __Sequence__are_equal(&lhs->MEMBER, &rhs->MEMBER);
#define FORGE_TD_COPY_NUMBER(TYPE, MEMBER) output->MEMBER = input->MEMBER;
#define FORGE_TD_COPY(TYPE, MEMBER) done = done && TYPE ## __copy(&input->MEMBER, &output->MEMBER);
#define FORGE_TD_COPY_SEQUENCE(TYPE, MEMBER) \
  done = done && TYPE ## __Sequence__copy(&input->MEMBER, &output->MEMBER);

/* Defines a message, its sequence, and the functions that generated messages have. */
#define FORGE_TD_MESSAGE(TYPE, MEMBERS) \
  typedef struct TYPE \
  { \
    MEMBERS(FORGE_TD_DECLARE, FORGE_TD_DECLARE, FORGE_TD_DECLARE_SEQUENCE) \
  } TYPE; \
  \
  typedef struct TYPE ## __Sequence \
  { \
    TYPE * data; \
    size_t size; \
    size_t capacity; \
  } TYPE ## __Sequence; \
  \
  static inline void TYPE ## __fini(TYPE * message) \
  { \
    if (message) { \
      MEMBERS(FORGE_TD_NOTHING, FORGE_TD_FINI, FORGE_TD_FINI_SEQUENCE) \
    } \
  } \
  \
  static inline bool TYPE ## __init(TYPE * message) \
  { \
    if (!message) { \
      return false; \
    } \
    bool done = true; \
    memset(message, 0, sizeof(*message)); \
    MEMBERS(FORGE_TD_NOTHING, FORGE_TD_INIT, FORGE_TD_NOTHING) \
    if (!done) { \
      TYPE ## __fini(message); \
    } \
    return done; \
  } \
  \
  static inline TYPE * TYPE ## __create(void) \
  { \
    TYPE * message = (TYPE *)malloc(sizeof(*message)); \
    if (!TYPE ## __init(message)) { \
      free(message); \
      return NULL; \
    } \
    return message; \
  } \
  \
  static inline void TYPE ## __destroy(TYPE * message) \
  { \
    TYPE ## __fini(message); \
    free(message); \
  } \
  \
  static inline bool TYPE ## __are_equal(const TYPE * lhs, const TYPE * rhs) \
  { \
    if (!lhs || !rhs) { \
      return false; \
    } \
    bool equal = true; \
    MEMBERS(FORGE_TD_EQUAL_NUMBER, FORGE_TD_EQUAL, FORGE_TD_EQUAL_SEQUENCE) \
    return equal; \
  } \
  \
  static inline bool TYPE ## __copy(const TYPE * input, TYPE * output) \
  { \
    if (!input || !output) { \
      return false; \
    } \
    bool done = true; \
    MEMBERS(FORGE_TD_COPY_NUMBER, FORGE_TD_COPY, FORGE_TD_COPY_SEQUENCE) \
    return done; \
  } \
  \
  ROSIDL_RUNTIME_C__SEQUENCE_FUNCTIONS(TYPE)

FORGE_TD_MESSAGE(rosidl_runtime_c__type_description__FieldType, FORGE_TD_FIELD_TYPE)
FORGE_TD_MESSAGE(rosidl_runtime_c__type_description__Field, FORGE_TD_FIELD)
FORGE_TD_MESSAGE(
  rosidl_runtime_c__type_description__IndividualTypeDescription, FORGE_TD_INDIVIDUAL_TYPE_DESCRIPTION)
FORGE_TD_MESSAGE(rosidl_runtime_c__type_description__TypeDescription, FORGE_TD_TYPE_DESCRIPTION)
FORGE_TD_MESSAGE(rosidl_runtime_c__type_description__TypeSource, FORGE_TD_TYPE_SOURCE)
FORGE_TD_MESSAGE(rosidl_runtime_c__type_description__KeyValue, FORGE_TD_KEY_VALUE)

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_H_ */
