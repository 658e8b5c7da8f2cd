#ifndef ROSIDL_RUNTIME_C__TYPE_HASH_H_
#define ROSIDL_RUNTIME_C__TYPE_HASH_H_

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define ROSIDL_TYPE_HASH_VERSION_UNSET 0
#define ROSIDL_TYPE_HASH_SIZE 32

/* The size of the text of a hash, without the NUL. */
#define FORGE_TYPE_HASH_TEXT_SIZE (7 + 2 * ROSIDL_TYPE_HASH_SIZE)

#ifdef __cplusplus
extern "C"
{
#endif

/* The hash of the definition of a type (REP 2016): "RIHS01_" and the 64 hexadecimal digits of a SHA-256. */
typedef struct rosidl_type_hash_s
{
  uint8_t version;
  uint8_t value[ROSIDL_TYPE_HASH_SIZE];
} rosidl_type_hash_t;

/* Return a hash of the version ROSIDL_TYPE_HASH_VERSION_UNSET. */
static inline rosidl_type_hash_t rosidl_get_zero_initialized_type_hash(void)
{
  rosidl_type_hash_t hash;
  memset(&hash, 0, sizeof(hash));
  return hash;
}

/* Write the text of a hash and a NUL; `text` has room for FORGE_TYPE_HASH_TEXT_SIZE + 1 bytes. */
static inline void forge_write_type_hash(const rosidl_type_hash_t * hash, char * text)
{
  snprintf(text, 8, "RIHS%02x_", hash->version);
  for (size_t i = 0; i < ROSIDL_TYPE_HASH_SIZE; ++i) {
    snprintf(text + 7 + 2 * i, 3, "%02x", hash->value[i]);
  }
}

/* Read the byte that two hexadecimal digits stand for. */
static inline bool forge_read_hex_byte(const char * text, uint8_t * byte)
{
  static const char digits[] = "0123456789abcdef0123456789ABCDEF";
  const char * high = text[0] ? strchr(digits, text[0]) : NULL;
  const char * low = high && text[1] ? strchr(digits, text[1]) : NULL;
  if (!low) {
    return false;
  }
  *byte = (uint8_t)((high - digits) % 16 * 16 + (low - digits) % 16);
  return true;
}

/* Read a hash of version 1. If only its version can be read, it is set, and the result is false. */
static inline bool forge_read_type_hash(const char * text, rosidl_type_hash_t * hash)
{
  hash->version = ROSIDL_TYPE_HASH_VERSION_UNSET;
  if (strncmp(text, "RIHS", 4) != 0 || !forge_read_hex_byte(text + 4, &hash->version)) {
    return false;
  }
  if (hash->version != 1 || text[6] != '_' || strlen(text) != FORGE_TYPE_HASH_TEXT_SIZE) {
    return false;
  }
  for (size_t i = 0; i < ROSIDL_TYPE_HASH_SIZE; ++i) {
    if (!forge_read_hex_byte(text + 7 + 2 * i, &hash->value[i])) {
      return false;
    }
  }
  return true;
}

#ifdef __cplusplus
}
#endif

/* rosidl's own functions use types of rcutils, so they are available where rcutils is. */
#ifdef __has_include
#if __has_include("rcutils/allocator.h") && __has_include("rcutils/types/rcutils_ret.h")
#include "rosidl_runtime_c/detail/type_hash_rcutils.h"
#endif
#endif

#endif  /* ROSIDL_RUNTIME_C__TYPE_HASH_H_ */
