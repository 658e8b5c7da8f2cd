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

/* Returns the type support with this identifier; a handle may contain several. */
typedef const rosidl_service_type_support_t * (* rosidl_service_typesupport_handle_function)(
  const rosidl_service_type_support_t *, const char *);

/* The type support of a service, for middlewares. */
struct rosidl_service_type_support_t
{
  /* Identifies the type of `data`. */
  const char * typesupport_identifier;
  const void * data;
  rosidl_service_typesupport_handle_function func;
};

/* Return the type support of a handle with this identifier, or NULL. */
static inline const rosidl_service_type_support_t * get_service_typesupport_handle(
  const rosidl_service_type_support_t * handle, const char * identifier)
{
  return handle->func(handle, identifier);
}

/* The `func` of a handle with a single type support. */
static inline const rosidl_service_type_support_t * get_service_typesupport_handle_function(
  const rosidl_service_type_support_t * handle, const char * identifier)
{
  return strcmp(handle->typesupport_identifier, identifier) == 0 ? handle : NULL;
}

/* Returns the C type support of a service. */
#define ROSIDL_GET_SRV_TYPE_SUPPORT(PkgName, SrvSubfolder, SrvName) \
  ROSIDL_TYPESUPPORT_INTERFACE__SERVICE_SYMBOL_NAME( \
    rosidl_typesupport_c, PkgName, SrvSubfolder, SrvName)()

/* Defines the function that the macro above calls; used in generated headers. It is not defined by other run
 * times, which provide libraries with these functions. */
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
