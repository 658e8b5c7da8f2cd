#ifndef ROSIDL_RUNTIME_C__DETAIL__TYPE_HASH_RCUTILS_H_
#define ROSIDL_RUNTIME_C__DETAIL__TYPE_HASH_RCUTILS_H_

#include "rcutils/allocator.h"
#include "rcutils/types/rcutils_ret.h"
#include "rosidl_runtime_c/type_hash.h"

#ifdef __cplusplus
extern "C"
{
#endif

/* Write the text of a hash to new memory, which the caller returns to the allocator. */
static inline rcutils_ret_t rosidl_stringify_type_hash(
  const rosidl_type_hash_t * type_hash, rcutils_allocator_t allocator, char ** output_string)
{
  if (!type_hash || !output_string || !allocator.allocate) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  *output_string = (char *)allocator.allocate(FORGE_TYPE_HASH_TEXT_SIZE + 1, allocator.state);
  if (!*output_string) {
    return RCUTILS_RET_BAD_ALLOC;
  }
  forge_write_type_hash(type_hash, *output_string);
  return RCUTILS_RET_OK;
}

/* Read a hash from its text. */
static inline rcutils_ret_t rosidl_parse_type_hash_string(
  const char * type_hash_string, rosidl_type_hash_t * hash_out)
{
  if (!type_hash_string || !hash_out || !forge_read_type_hash(type_hash_string, hash_out)) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  return RCUTILS_RET_OK;
}

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__DETAIL__TYPE_HASH_RCUTILS_H_ */
