#ifndef ROSIDL_RUNTIME_C__TYPE_DESCRIPTION__FIELD__STRUCT_H_
#define ROSIDL_RUNTIME_C__TYPE_DESCRIPTION__FIELD__STRUCT_H_

#include "rosidl_runtime_c/detail/type_description_struct.h"

#endif  /* ROSIDL_RUNTIME_C__TYPE_DESCRIPTION__FIELD__STRUCT_H_ */
