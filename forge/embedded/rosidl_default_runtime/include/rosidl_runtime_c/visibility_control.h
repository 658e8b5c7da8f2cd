#ifndef ROSIDL_RUNTIME_C__VISIBILITY_CONTROL_H_
#define ROSIDL_RUNTIME_C__VISIBILITY_CONTROL_H_

/* Visibility macros. The functions here are inline and do not use them; they are for libraries that wrap
 * these functions. */

#if defined _WIN32 || defined __CYGWIN__
#ifdef __GNUC__
#define ROSIDL_GENERATOR_C_EXPORT __attribute__((dllexport))
#define ROSIDL_GENERATOR_C_IMPORT __attribute__((dllimport))
#else
#define ROSIDL_GENERATOR_C_EXPORT __declspec(dllexport)
#define ROSIDL_GENERATOR_C_IMPORT __declspec(dllimport)
#endif
#ifdef ROSIDL_GENERATOR_C_BUILDING_DLL
#define ROSIDL_GENERATOR_C_PUBLIC ROSIDL_GENERATOR_C_EXPORT
#else
#define ROSIDL_GENERATOR_C_PUBLIC ROSIDL_GENERATOR_C_IMPORT
#endif
#define ROSIDL_GENERATOR_C_LOCAL
#else
#define ROSIDL_GENERATOR_C_EXPORT __attribute__((visibility("default")))
#define ROSIDL_GENERATOR_C_IMPORT
#define ROSIDL_GENERATOR_C_PUBLIC __attribute__((visibility("default")))
#define ROSIDL_GENERATOR_C_LOCAL __attribute__((visibility("hidden")))
#endif

#endif  /* ROSIDL_RUNTIME_C__VISIBILITY_CONTROL_H_ */
