#ifndef ROSIDL_RUNTIME_C__MESSAGE_TYPE_SUPPORT_STRUCT_H_
#define ROSIDL_RUNTIME_C__MESSAGE_TYPE_SUPPORT_STRUCT_H_

#include "rosidl_typesupport_interface/macros.h"

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

/* The type support of a message, from a program in C. */
#define ROSIDL_GET_MSG_TYPE_SUPPORT(PkgName, MsgSubfolder, MsgName) \
  ROSIDL_TYPESUPPORT_INTERFACE__MESSAGE_SYMBOL_NAME( \
    rosidl_typesupport_c, PkgName, MsgSubfolder, MsgName)()

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__MESSAGE_TYPE_SUPPORT_STRUCT_H_ */
