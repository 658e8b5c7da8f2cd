#ifndef ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_H_
#define ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_H_

/* The functions of the messages, as generated messages have them. */

#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "rosidl_runtime_c/detail/type_description_struct.h"
#include "rosidl_runtime_c/message_type_support_struct.h"
#include "rosidl_runtime_c/sequence_functions.h"
#include "rosidl_runtime_c/string_functions.h"
#include "rosidl_runtime_c/type_hash.h"

#ifdef __cplusplus
extern "C"
{
#endif

/* What the functions below do with a member. */
#define FORGE_TD_NOTHING(TYPE, MEMBER)
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

/* Defines the functions of a message and of its sequence. */
#define FORGE_TD_FUNCTIONS(TYPE, MEMBERS) \
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

FORGE_TD_FUNCTIONS(rosidl_runtime_c__type_description__FieldType, FORGE_TD_FIELD_TYPE)
FORGE_TD_FUNCTIONS(rosidl_runtime_c__type_description__Field, FORGE_TD_FIELD)
FORGE_TD_FUNCTIONS(
  rosidl_runtime_c__type_description__IndividualTypeDescription, FORGE_TD_INDIVIDUAL_TYPE_DESCRIPTION)
FORGE_TD_FUNCTIONS(rosidl_runtime_c__type_description__TypeDescription, FORGE_TD_TYPE_DESCRIPTION)
FORGE_TD_FUNCTIONS(rosidl_runtime_c__type_description__TypeSource, FORGE_TD_TYPE_SOURCE)
FORGE_TD_FUNCTIONS(rosidl_runtime_c__type_description__KeyValue, FORGE_TD_KEY_VALUE)

/* Defines the function that returns the hash of a message, that of the one in type_description_interfaces. */
#define FORGE_TD_HASH(TYPE, ...) \
  static inline const rosidl_type_hash_t * TYPE ## __get_type_hash( \
    const rosidl_message_type_support_t * type_support) \
  { \
    static const rosidl_type_hash_t hash = {1, {__VA_ARGS__}}; \
    (void)type_support; \
    return &hash; \
  }

FORGE_TD_HASH(
  rosidl_runtime_c__type_description__FieldType,
  0xa7, 0x0b, 0x6d, 0xd9, 0x19, 0x64, 0x5a, 0x03,
  0xa3, 0x58, 0x6f, 0x7f, 0x82, 0x1d, 0xef, 0xbc,
  0x88, 0x6e, 0xa3, 0xe5, 0x31, 0xa1, 0xd9, 0x5c,
  0xc0, 0xf3, 0x80, 0xa3, 0x97, 0x3c, 0xca, 0xa6)
FORGE_TD_HASH(
  rosidl_runtime_c__type_description__Field,
  0xc0, 0xb0, 0x13, 0x79, 0xcd, 0x42, 0x26, 0x28,
  0x12, 0x85, 0xcc, 0xaf, 0x6b, 0xe4, 0x66, 0x53,
  0x96, 0x8f, 0x85, 0x5f, 0x7c, 0x5e, 0x41, 0x61,
  0x4f, 0xf5, 0xd7, 0xa8, 0x54, 0xef, 0xef, 0x7c)
FORGE_TD_HASH(
  rosidl_runtime_c__type_description__IndividualTypeDescription,
  0x55, 0xc8, 0x27, 0xd8, 0x6c, 0x3c, 0x14, 0x1b,
  0xdd, 0x31, 0x8f, 0xe6, 0xc2, 0x2e, 0x11, 0x19,
  0x0e, 0x4d, 0x3b, 0x37, 0xc8, 0xf4, 0xf9, 0x75,
  0x1a, 0x08, 0x4a, 0xa0, 0x5c, 0xe9, 0x65, 0x60)
FORGE_TD_HASH(
  rosidl_runtime_c__type_description__TypeDescription,
  0x73, 0x9f, 0x25, 0x08, 0xc9, 0xfa, 0x3a, 0x6f,
  0x33, 0x09, 0x13, 0xff, 0x5b, 0x9d, 0x25, 0xfb,
  0x74, 0x15, 0x9a, 0x07, 0x7d, 0xa7, 0x1e, 0x10,
  0x87, 0xf5, 0x1a, 0x60, 0xc1, 0x2a, 0x08, 0x0b)
FORGE_TD_HASH(
  rosidl_runtime_c__type_description__TypeSource,
  0xfa, 0xea, 0xec, 0x75, 0x96, 0xc0, 0x4e, 0xcf,
  0x5b, 0x6e, 0x99, 0xad, 0x22, 0x5e, 0x4c, 0x7c,
  0xbb, 0x99, 0x7a, 0xd5, 0x43, 0x5f, 0x79, 0x35,
  0x26, 0xfb, 0x39, 0x84, 0xd0, 0x11, 0xaa, 0xe5)
FORGE_TD_HASH(
  rosidl_runtime_c__type_description__KeyValue,
  0x27, 0x4f, 0xe5, 0x6b, 0xf1, 0x4f, 0x33, 0xc7,
  0x51, 0x2e, 0x34, 0xc6, 0x46, 0xa3, 0x75, 0x79,
  0xee, 0x36, 0x77, 0x9f, 0x74, 0x5f, 0x04, 0x9a,
  0x97, 0x60, 0x76, 0x3e, 0x81, 0x7f, 0x0c, 0x42)

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_H_ */
