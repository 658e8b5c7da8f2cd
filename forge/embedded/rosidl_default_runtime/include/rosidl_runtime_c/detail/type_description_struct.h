#ifndef ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_STRUCT_H_
#define ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_STRUCT_H_

/* The messages of type_description_interfaces for programs that must not depend on that package. */

#include <stddef.h>
#include <stdint.h>

#include "rosidl_runtime_c/string.h"

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

#define FORGE_TD_DECLARE(TYPE, MEMBER) TYPE MEMBER;
#define FORGE_TD_DECLARE_SEQUENCE(TYPE, MEMBER) TYPE ## __Sequence MEMBER;

/* Declares a message and its sequence. */
#define FORGE_TD_STRUCT(TYPE, MEMBERS) \
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
  } TYPE ## __Sequence;

FORGE_TD_STRUCT(rosidl_runtime_c__type_description__FieldType, FORGE_TD_FIELD_TYPE)
FORGE_TD_STRUCT(rosidl_runtime_c__type_description__Field, FORGE_TD_FIELD)
FORGE_TD_STRUCT(
  rosidl_runtime_c__type_description__IndividualTypeDescription, FORGE_TD_INDIVIDUAL_TYPE_DESCRIPTION)
FORGE_TD_STRUCT(rosidl_runtime_c__type_description__TypeDescription, FORGE_TD_TYPE_DESCRIPTION)
FORGE_TD_STRUCT(rosidl_runtime_c__type_description__TypeSource, FORGE_TD_TYPE_SOURCE)
FORGE_TD_STRUCT(rosidl_runtime_c__type_description__KeyValue, FORGE_TD_KEY_VALUE)

#endif  /* ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_STRUCT_H_ */
