#ifndef ROSIDL_RUNTIME_C__MESSAGE_TYPE_SUPPORT_STRUCT_H_
#define ROSIDL_RUNTIME_C__MESSAGE_TYPE_SUPPORT_STRUCT_H_

#include <stddef.h>
#include <string.h>

#include "rosidl_typesupport_interface/macros.h"

/* The identifier of handles in generated C. Their data is the name of the type, "pkg/msg/Name". */
#define FORGE_TYPESUPPORT_C "forge_typesupport_c"

#ifdef __cplusplus
extern "C"
{
#endif

typedef struct rosidl_message_type_support_t rosidl_message_type_support_t;

/* Returns the type support with this identifier; a handle may contain several. */
typedef const rosidl_message_type_support_t * (* rosidl_message_typesupport_handle_function)(
  const rosidl_message_type_support_t *, const char *);

/* The type support of a message, for middlewares. */
struct rosidl_message_type_support_t
{
  /* Identifies the type of `data`. */
  const char * typesupport_identifier;
  const void * data;
  rosidl_message_typesupport_handle_function func;
};

/* Return the type support of a handle with this identifier, or NULL. */
static inline const rosidl_message_type_support_t * get_message_typesupport_handle(
  const rosidl_message_type_support_t * handle, const char * identifier)
{
  return handle->func(handle, identifier);
}

/* The `func` of a handle with a single type support. */
static inline const rosidl_message_type_support_t * get_message_typesupport_handle_function(
  const rosidl_message_type_support_t * handle, const char * identifier)
{
  return strcmp(handle->typesupport_identifier, identifier) == 0 ? handle : NULL;
}

/* Returns the C type support of a message. */
#define ROSIDL_GET_MSG_TYPE_SUPPORT(PkgName, MsgSubfolder, MsgName) \
  ROSIDL_TYPESUPPORT_INTERFACE__MESSAGE_SYMBOL_NAME( \
    rosidl_typesupport_c, PkgName, MsgSubfolder, MsgName)()

/* Defines the function that the macro above calls; used in generated headers. It is not defined by other run
 * times, which provide libraries with these functions. */
#define FORGE_C_MESSAGE_TYPE_SUPPORT(package, kind, name) \
  static inline const rosidl_message_type_support_t * \
  rosidl_typesupport_c__get_message_type_support_handle__ ## package ## __ ## kind ## __ ## name(void) \
  { \
    static const rosidl_message_type_support_t handle = \
      FORGE_C_MESSAGE_HANDLE(#package "/" #kind "/" #name); \
    return &handle; \
  }

#define FORGE_C_MESSAGE_HANDLE(name) \
  {FORGE_TYPESUPPORT_C, name, get_message_typesupport_handle_function}

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__MESSAGE_TYPE_SUPPORT_STRUCT_H_ */
