#ifndef ROSIDL_RUNTIME_C__ACTION_TYPE_SUPPORT_STRUCT_H_
#define ROSIDL_RUNTIME_C__ACTION_TYPE_SUPPORT_STRUCT_H_

#include "rosidl_runtime_c/message_type_support_struct.h"
#include "rosidl_runtime_c/service_type_support_struct.h"

#ifdef __cplusplus
extern "C"
{
#endif

typedef struct rosidl_action_type_support_t rosidl_action_type_support_t;

/* The type supports of the services and topics of an action. */
struct rosidl_action_type_support_t
{
  const rosidl_service_type_support_t * goal_service_type_support;
  const rosidl_service_type_support_t * result_service_type_support;
  const rosidl_service_type_support_t * cancel_service_type_support;
  const rosidl_message_type_support_t * feedback_message_type_support;
  const rosidl_message_type_support_t * status_message_type_support;
};

/* Returns the C type support of an action. */
#define ROSIDL_GET_ACTION_TYPE_SUPPORT(PkgName, ActionName) \
  ROSIDL_TYPESUPPORT_INTERFACE__ACTION_SYMBOL_NAME( \
    rosidl_typesupport_c, PkgName, action, ActionName)()

/* Defines the function that the macro above calls; used in generated headers. */
#define FORGE_C_ACTION_TYPE_SUPPORT(package, kind, name) \
  static inline const rosidl_action_type_support_t * \
  rosidl_typesupport_c__get_action_type_support_handle__ ## package ## __ ## kind ## __ ## name(void) \
  { \
    static const rosidl_service_type_support_t goal = \
      FORGE_C_SERVICE_HANDLE(#package "/" #kind "/" #name "_SendGoal"); \
    static const rosidl_service_type_support_t result = \
      FORGE_C_SERVICE_HANDLE(#package "/" #kind "/" #name "_GetResult"); \
    static const rosidl_service_type_support_t cancel = \
      FORGE_C_SERVICE_HANDLE("action_msgs/srv/CancelGoal"); \
    static const rosidl_message_type_support_t feedback = \
      FORGE_C_MESSAGE_HANDLE(#package "/" #kind "/" #name "_FeedbackMessage"); \
    static const rosidl_message_type_support_t status = \
      FORGE_C_MESSAGE_HANDLE("action_msgs/msg/GoalStatusArray"); \
    static const rosidl_action_type_support_t handle = {&goal, &result, &cancel, &feedback, &status}; \
    return &handle; \
  }

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__ACTION_TYPE_SUPPORT_STRUCT_H_ */
