#ifndef ROSIDL_RUNTIME_C__DETAIL__STATIC_DESCRIPTION_H_
#define ROSIDL_RUNTIME_C__DETAIL__STATIC_DESCRIPTION_H_

/* What the generated descriptions of types are made of: initializers of static messages. */

#include <stdbool.h>
#include <stddef.h>

#include "rosidl_runtime_c/action_type_support_struct.h"
#include "rosidl_runtime_c/detail/type_description_struct.h"
#include "rosidl_runtime_c/message_type_support_struct.h"
#include "rosidl_runtime_c/service_type_support_struct.h"
#include "rosidl_runtime_c/type_hash.h"

#define FORGE_TD_STATIC_TEXT(literal) {(char *)(literal), sizeof(literal) - 1, sizeof(literal) - 1}
#define FORGE_TD_STATIC_SEQUENCE(elements, size) {elements, size, size}
#define FORGE_TD_STATIC_FIELD(name, type_id, capacity, string_capacity, nested_type, default_value) \
  { \
    FORGE_TD_STATIC_TEXT(name), \
    {type_id, capacity, string_capacity, FORGE_TD_STATIC_TEXT(nested_type)}, \
    FORGE_TD_STATIC_TEXT(default_value) \
  }

#endif  /* ROSIDL_RUNTIME_C__DETAIL__STATIC_DESCRIPTION_H_ */
