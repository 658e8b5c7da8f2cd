#ifndef ROSIDL_RUNTIME_C__SEQUENCE_BOUND_H_
#define ROSIDL_RUNTIME_C__SEQUENCE_BOUND_H_

#include <stddef.h>
#include <string.h>

#ifdef __cplusplus
extern "C"
{
#endif

typedef struct rosidl_runtime_c__Sequence__bound rosidl_runtime_c__Sequence__bound;

/* Returns the bound with this identifier; a handle may contain several. */
typedef const rosidl_runtime_c__Sequence__bound * (* rosidl_runtime_c__bound_handle_function)(
  const rosidl_runtime_c__Sequence__bound *, const char *);

/* The upper bound of a sequence, for middlewares. */
struct rosidl_runtime_c__Sequence__bound
{
  /* Identifies the type of `data`. */
  const char * typesupport_identifier;
  const void * data;
  rosidl_runtime_c__bound_handle_function func;
};

/* Return the bound of a handle with this identifier, or NULL. */
static inline const rosidl_runtime_c__Sequence__bound * get_sequence_bound_handle(
  const rosidl_runtime_c__Sequence__bound * handle, const char * identifier)
{
  return handle->func(handle, identifier);
}

/* The `func` of a handle with a single bound. */
static inline const rosidl_runtime_c__Sequence__bound * get_sequence_bound_handle_function(
  const rosidl_runtime_c__Sequence__bound * handle, const char * identifier)
{
  return strcmp(handle->typesupport_identifier, identifier) == 0 ? handle : NULL;
}

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__SEQUENCE_BOUND_H_ */
