#ifndef WALKER__VISIBILITY_CONTROL_H_
#define WALKER__VISIBILITY_CONTROL_H_

// Mark the public API with WALKER_PUBLIC and internal symbols with WALKER_LOCAL.
// See https://gcc.gnu.org/wiki/Visibility.

#if defined(_WIN32) || defined(__CYGWIN__)
#  ifdef __GNUC__
#    define WALKER_EXPORT __attribute__((dllexport))
#    define WALKER_IMPORT __attribute__((dllimport))
#  else
#    define WALKER_EXPORT __declspec(dllexport)
#    define WALKER_IMPORT __declspec(dllimport)
#  endif
#  define WALKER_LOCAL
#elif defined(__GNUC__)
#  define WALKER_EXPORT __attribute__((visibility("default")))
#  define WALKER_IMPORT __attribute__((visibility("default")))
#  define WALKER_LOCAL __attribute__((visibility("hidden")))
#else
#  define WALKER_EXPORT
#  define WALKER_IMPORT
#  define WALKER_LOCAL
#endif

#ifdef WALKER_BUILDING_LIBRARY
#  define WALKER_PUBLIC WALKER_EXPORT
#else
#  define WALKER_PUBLIC WALKER_IMPORT
#endif

#endif  // WALKER__VISIBILITY_CONTROL_H_
