#ifndef ROSIDL_RUNTIME_C__SERVICE_TYPE_SUPPORT_STRUCT_H_
#define ROSIDL_RUNTIME_C__SERVICE_TYPE_SUPPORT_STRUCT_H_

#include <stddef.h>
#include <string.h>

#include "rosidl_runtime_c/message_type_support_struct.h"
#include "rosidl_typesupport_interface/macros.h"

#ifdef __cplusplus
extern "C"
{
#endif

typedef struct rosidl_service_type_support_t rosidl_service_type_support_t;

/* Finds the type support that has this identifier, starting from one that may hold several. */
typedef const rosidl_service_type_support_t * (* rosidl_service_typesupport_handle_function)(
  const rosidl_service_type_support_t *, const char *);

/* How a middleware gets at the code for a service. */
struct rosidl_service_type_support_t
{
  /* Tells what `data` points to. */
  const char * typesupport_identifier;
  const void * data;
  rosidl_service_typesupport_handle_function func;
};

/* Ask a handle for the type support that has this identifier; NULL if it knows none. */
static inline const rosidl_service_type_support_t * get_service_typesupport_handle(
  const rosidl_service_type_support_t * handle, const char * identifier)
{
  return handle->func(handle, identifier);
}

/* The answer of a handle that holds nothing but itself: its `func`. */
static inline const rosidl_service_type_support_t * get_service_typesupport_handle_function(
  const rosidl_service_type_support_t * handle, const char * identifier)
{
  return strcmp(handle->typesupport_identifier, identifier) == 0 ? handle : NULL;
}

/* The type support of a service, from a program in C. */
#define ROSIDL_GET_SRV_TYPE_SUPPORT(PkgName, SrvSubfolder, SrvName) \
  ROSIDL_TYPESUPPORT_INTERFACE__SERVICE_SYMBOL_NAME( \
    rosidl_typesupport_c, PkgName, SrvSubfolder, SrvName)()

/* Generated headers define by this the function that the macro above calls. Where it is missing, the run time
 * is not forge's and brings libraries with those functions. */
#define FORGE_C_SERVICE_TYPE_SUPPORT(package, kind, name) \
  static inline const rosidl_service_type_support_t * \
  rosidl_typesupport_c__get_service_type_support_handle__ ## package ## __ ## kind ## __ ## name(void) \
  { \
    static const rosidl_service_type_support_t handle = \
      FORGE_C_SERVICE_HANDLE(#package "/" #kind "/" #name); \
    return &handle; \
  }

#define FORGE_C_SERVICE_HANDLE(name) \
  {FORGE_TYPESUPPORT_C, name, get_service_typesupport_handle_function}

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__SERVICE_TYPE_SUPPORT_STRUCT_H_ */
