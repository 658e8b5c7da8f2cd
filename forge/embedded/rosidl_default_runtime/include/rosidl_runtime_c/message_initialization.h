#ifndef ROSIDL_RUNTIME_C__MESSAGE_INITIALIZATION_H_
#define ROSIDL_RUNTIME_C__MESSAGE_INITIALIZATION_H_

/* How to initialize the members of a message; the values equal those of the C++ enumeration. */
enum rosidl_runtime_c__message_initialization
{
  ROSIDL_RUNTIME_C_MSG_INIT_ALL = 0,
  ROSIDL_RUNTIME_C_MSG_INIT_SKIP = 1,
  ROSIDL_RUNTIME_C_MSG_INIT_ZERO = 2,
  ROSIDL_RUNTIME_C_MSG_INIT_DEFAULTS_ONLY = 3
};

#endif  /* ROSIDL_RUNTIME_C__MESSAGE_INITIALIZATION_H_ */
