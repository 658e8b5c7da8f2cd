#ifndef ROSIDL_RUNTIME_C__MESSAGE_TYPE_SUPPORT_STRUCT_H_
#define ROSIDL_RUNTIME_C__MESSAGE_TYPE_SUPPORT_STRUCT_H_

#include <stddef.h>
#include <string.h>

#include "rosidl_typesupport_interface/macros.h"

/* What handles of generated C are called here. They hold the type's name, "pkg/msg/Name", and no code. */
#define FORGE_TYPESUPPORT_C "forge_typesupport_c"

#ifdef __cplusplus
extern "C"
{
#endif

typedef struct rosidl_message_type_support_t rosidl_message_type_support_t;

/* Finds the type support that has this identifier, starting from one that may hold several. */
typedef const rosidl_message_type_support_t * (* rosidl_message_typesupport_handle_function)(
  const rosidl_message_type_support_t *, const char *);

/* How a middleware gets at the code for a message. */
struct rosidl_message_type_support_t
{
  /* Tells what `data` points to. */
  const char * typesupport_identifier;
  const void * data;
  rosidl_message_typesupport_handle_function func;
};

/* Ask a handle for the type support that has this identifier; NULL if it knows none. */
static inline const rosidl_message_type_support_t * get_message_typesupport_handle(
  const rosidl_message_type_support_t * handle, const char * identifier)
{
  return handle->func(handle, identifier);
}

/* The answer of a handle that holds nothing but itself: its `func`. */
static inline const rosidl_message_type_support_t * get_message_typesupport_handle_function(
  const rosidl_message_type_support_t * handle, const char * identifier)
{
  return strcmp(handle->typesupport_identifier, identifier) == 0 ? handle : NULL;
}

/* The type support of a message, from a program in C. */
#define ROSIDL_GET_MSG_TYPE_SUPPORT(PkgName, MsgSubfolder, MsgName) \
  ROSIDL_TYPESUPPORT_INTERFACE__MESSAGE_SYMBOL_NAME( \
    rosidl_typesupport_c, PkgName, MsgSubfolder, MsgName)()

/* Generated headers define by this the function that the macro above calls. Where it is missing, the run time
 * is not forge's and brings libraries with those functions. */
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
