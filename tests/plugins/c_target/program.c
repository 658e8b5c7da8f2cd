/* Messages in the hands of a C program: made, filled, compared, copied, given back, with and without memory.
 *
 * It is C99 and C++17 at once. Memory comes from here, so that it can run out at any moment. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static size_t memory_left = SIZE_MAX;

static int lasts(size_t size)
{
  if (memory_left == 0 || size > SIZE_MAX / 4) {
    return 0;
  }
  --memory_left;
  return 1;
}

static void * limited_malloc(size_t size)
{
  return lasts(size) ? malloc(size) : NULL;
}

static void * limited_calloc(size_t count, size_t size)
{
  return lasts(count) ? calloc(count, size) : NULL;
}

static void * limited_realloc(void * data, size_t size)
{
  return lasts(size) ? realloc(data, size) : NULL;
}

#define malloc limited_malloc
#define calloc limited_calloc
#define realloc limited_realloc

#include "example_interfaces/action/fibonacci.h"
#include "geometry_msgs/msg/pose.h"
#include "probe/msg/bounded.h"
#include "probe/msg/constants.h"
#include "probe/msg/defaults.h"
#include "probe/msg/empty.h"
#include "probe/msg/names.h"
#include "probe/msg/nest.h"
#include "probe/msg/wide.h"
#include "rosidl_runtime_c/sequence_bound.h"
#include "rosidl_runtime_c/type_description_utils.h"
#include "rosidl_runtime_c/type_hash.h"
#include "sensor_msgs/msg/image.h"
#include "std_msgs/msg/float64_multi_array.h"
#include "std_msgs/msg/string.h"
#include "std_srvs/srv/set_bool.h"

static int failures = 0;

#define CHECK(condition) \
  do { \
    if (!(condition)) { \
      fprintf(stderr, "line %d: %s\n", __LINE__, #condition); \
      ++failures; \
    } \
  } while (0)

static void texts_are_made_and_given_back(void)
{
  std_msgs__msg__String * message = std_msgs__msg__String__create();
  CHECK(message && message->data.size == 0 && strcmp(message->data.data, "") == 0);
  CHECK(rosidl_runtime_c__String__assign(&message->data, "hello"));
  CHECK(message->data.size == 5 && message->data.capacity == 6);
  CHECK(rosidl_runtime_c__String__assignn(&message->data, "hello", 2));
  CHECK(strcmp(message->data.data, "he") == 0 && message->data.capacity == 6);
  CHECK(rosidl_runtime_c__String__assignn(&message->data, message->data.data + 1, 1));
  CHECK(strcmp(message->data.data, "e") == 0);
  CHECK(!rosidl_runtime_c__String__assign(&message->data, NULL));
  CHECK(!rosidl_runtime_c__String__assignn(&message->data, "", SIZE_MAX));
  CHECK(strcmp(message->data.data, "e") == 0);
  CHECK(rosidl_runtime_c__String__assign(&message->data, "") && message->data.capacity == 1);
  std_msgs__msg__String__destroy(message);
}

static void a_text_grows_out_of_itself(void)
{
  rosidl_runtime_c__String text;
  CHECK(rosidl_runtime_c__String__init(&text));
  CHECK(rosidl_runtime_c__String__assign(&text, "ab"));
  /* The NUL counts as well: three bytes, for which there is no room beside a new NUL. */
  CHECK(rosidl_runtime_c__String__assignn(&text, text.data, 3));
  CHECK(text.size == 3 && memcmp(text.data, "ab\0", 4) == 0);
  CHECK(rosidl_runtime_c__String__copy(&text, &text) && text.size == 3);
  CHECK(rosidl_runtime_c__String__resize(&text, 5) && text.size == 5 && text.capacity == 6);
  CHECK(memcmp(text.data, "ab\0\0\0", 6) == 0);
  CHECK(rosidl_runtime_c__String__resize(&text, 1) && strcmp(text.data, "a") == 0);
  CHECK(!rosidl_runtime_c__String__resize(&text, SIZE_MAX) && text.size == 1);
  CHECK(!rosidl_runtime_c__String__resize(NULL, 1));
  rosidl_runtime_c__String__fini(&text);
  rosidl_runtime_c__String__fini(&text);
  CHECK(rosidl_runtime_c__String__copy(&text, &text) && strcmp(text.data, "") == 0);
  rosidl_runtime_c__String__fini(&text);
}

static void wide_texts_count_units(void)
{
  static const uint_least16_t hi[] = {'h', 'i', 0};
  const char odd[] = {0, 'o', 0, 'k', 0};
  rosidl_runtime_c__U16String text;
  rosidl_runtime_c__U16String other;
  CHECK(rosidl_runtime_c__U16String__init(&text) && rosidl_runtime_c__U16String__init(&other));
  CHECK(rosidl_runtime_c__U16String__len(hi) == 2 && rosidl_runtime_c__U16String__len(NULL) == 0);
  CHECK(rosidl_runtime_c__U16String__assign(&text, hi) && text.size == 2 && text.data[2] == 0);
  CHECK(!rosidl_runtime_c__U16String__are_equal(&text, &other));
  CHECK(rosidl_runtime_c__U16String__copy(&text, &other));
  CHECK(rosidl_runtime_c__U16String__are_equal(&text, &other));
  CHECK(rosidl_runtime_c__U16String__resize(&text, 5) && text.size == 5 && text.data[4] == 0);
  CHECK(rosidl_runtime_c__U16String__resize(&text, 1) && text.data[0] == 'h' && text.data[1] == 0);
  CHECK(!rosidl_runtime_c__U16String__resize(&text, SIZE_MAX) && text.size == 1);
  CHECK(rosidl_runtime_c__U16String__assignn_from_char(&text, odd + 1, 4));
  CHECK(text.size == 2 && memcmp(text.data, odd + 1, 4) == 0 && text.data[2] == 0);
  CHECK(!rosidl_runtime_c__U16String__assignn_from_char(&text, odd, 3));
  CHECK(!rosidl_runtime_c__U16String__assignn(&text, hi, SIZE_MAX / 2));
  rosidl_runtime_c__U16String__fini(&text);
  CHECK(rosidl_runtime_c__U16String__copy(&text, &other) && other.size == 0);
  rosidl_runtime_c__U16String__fini(&other);
}

static void members_have_their_defaults(void)
{
  static const uint_least16_t wide[] = {'H', 'e', 'l', 'l', 0xf6, ' ', 'w', 0xf6, 'r', 'l', 'd', '!'};
  probe__msg__Defaults message;
  memset(&message, 0xff, sizeof(message));
  CHECK(probe__msg__Defaults__init(&message));
  CHECK(message.flag && message.octet == 255 && message.i8 == -128);
  CHECK(message.i64 == INT64_MIN && message.u64 == UINT64_MAX);
  CHECK(message.single == 0.1f && message.real == 0.1);
  CHECK(strcmp(message.text.data, "it's \"so\"") == 0);
  CHECK(message.wide.size == 12 && memcmp(message.wide.data, wide, sizeof(wide)) == 0);
  CHECK(message.three[0] == 1 && message.three[1] == -2 && message.three[2] == INT32_MIN);
  CHECK(message.many.size == 1 && message.many.data[0] == 7);
  CHECK(message.some.size == 2 && message.some.data[1] == 6);
  CHECK(message.flags.size == 2 && message.flags.data[0] && !message.flags.data[1]);
  CHECK(strcmp(message.pair[0].data, "a,b") == 0 && strcmp(message.pair[1].data, "c") == 0);
  CHECK(message.words.size == 2 && strcmp(message.words.data[1].data, "y") == 0);
  probe__msg__Defaults__fini(&message);
  probe__msg__Defaults__fini(&message);
  CHECK(message.text.data == NULL && message.words.data == NULL && message.words.capacity == 0);

  geometry_msgs__msg__Pose pose;
  CHECK(geometry_msgs__msg__Pose__init(&pose) && pose.orientation.w == 1.0 && pose.position.x == 0.0);
  probe__msg__Empty empty;
  CHECK(probe__msg__Empty__init(&empty) && empty.structure_needs_at_least_one_member == 0);
}

static void types_of_idl_only_have_theirs(void)
{
  probe__msg__Wide message;
  CHECK(probe__msg__Wide__init(&message));
  CHECK(message.precise == 1.5L && message.letter == 0 && sizeof(message.signs) == 2);
  CHECK(message.endless == HUGE_VALL && message.tiny[0] == 0.0f && isnan(message.tiny[1]));
  CHECK(message.sign == (signed char)200);
  CHECK(message.inside.size == 3 && memcmp(message.inside.data, "a\0b", 4) == 0);
  probe__msg__Wide__fini(&message);
}

static void constants_are_constant(void)
{
  switch (255) {
    case probe__msg__Constants__OCTET:
      break;
    default:
      CHECK(false);
  }
  CHECK(probe__msg__Constants__LOWEST == INT64_MIN && probe__msg__Constants__HIGHEST == UINT64_MAX);
  CHECK(probe__msg__Constants__LOW == INT32_MIN && probe__msg__Constants__ERROR == 1);
  CHECK(probe__msg__Constants__YES && probe__msg__Constants__TENTH == 0.1f);
  CHECK(probe__msg__Constants__ENDLESS == HUGE_VAL && isnan(probe__msg__Constants__NOTHING));
  CHECK(probe__msg__Constants__HUGE == HUGE_VALF && probe__msg__Constants__TINY == 0.0f);
  CHECK(probe__msg__Constants__LEAST > 0.0);
  CHECK(strcmp(probe__msg__Constants__QUOTED, "a \"b\" \\ c\n\tend?" "?/") == 0);
  CHECK(strcmp(probe__msg__Constants__NAME, "caf\303\251 \346\227\245") == 0);
  CHECK(sizeof(probe__msg__Constants__WIDE) == 10 * sizeof(uint_least16_t));
  CHECK(probe__msg__Constants__WIDE[3] == 0xe9 && probe__msg__Constants__WIDE[7] == 0xd83d);
  CHECK(probe__msg__Bounded__words__MAX_SIZE == 2 && probe__msg__Bounded__words__MAX_STRING_SIZE == 3);
  CHECK(probe__msg__Bounded__wide__MAX_STRING_SIZE == 4 && probe__msg__Bounded__some__MAX_SIZE == 3);
}

static void sequences_are_filled_as_ros_programs_do(void)
{
  sensor_msgs__msg__Image image;
  CHECK(sensor_msgs__msg__Image__init(&image));
  CHECK(rosidl_runtime_c__uint8__Sequence__init(&image.data, 6));
  memset(image.data.data, 7, image.data.size);
  CHECK(rosidl_runtime_c__String__assign(&image.encoding, "rgb8"));
  sensor_msgs__msg__Image copy;
  CHECK(sensor_msgs__msg__Image__init(&copy) && !sensor_msgs__msg__Image__are_equal(&image, &copy));
  CHECK(sensor_msgs__msg__Image__copy(&image, &copy) && sensor_msgs__msg__Image__are_equal(&image, &copy));
  copy.data.data[5] = 8;
  CHECK(!sensor_msgs__msg__Image__are_equal(&image, &copy));
  sensor_msgs__msg__Image__fini(&image);
  CHECK(sensor_msgs__msg__Image__copy(&image, &copy) && copy.data.size == 0 && copy.data.capacity == 6);
  sensor_msgs__msg__Image__fini(&copy);

  std_msgs__msg__Float64MultiArray array;
  CHECK(std_msgs__msg__Float64MultiArray__init(&array));
  CHECK(std_msgs__msg__MultiArrayDimension__Sequence__init(&array.layout.dim, 2));
  CHECK(rosidl_runtime_c__String__assign(&array.layout.dim.data[1].label, "columns"));
  std_msgs__msg__Float64MultiArray__fini(&array);

  /* The older names of some sequences. */
  rosidl_runtime_c__float64__Sequence numbers;
  CHECK(rosidl_runtime_c__float64__Sequence__init(&numbers, 3) && numbers.data[2] == 0.0);
  numbers.data[1] = NAN;
  CHECK(!rosidl_runtime_c__double__Sequence__are_equal(&numbers, &numbers));
  rosidl_runtime_c__float64__Sequence same = {NULL, 0, 0};
  CHECK(rosidl_runtime_c__float64__Sequence__copy(&numbers, &same) && same.size == 3);
  CHECK(!rosidl_runtime_c__float64__Sequence__are_equal(&numbers, &same));
  rosidl_runtime_c__float64__Sequence__fini(&same);
  rosidl_runtime_c__float64__Sequence__fini(&numbers);
  CHECK(!rosidl_runtime_c__double__Sequence__init(&numbers, SIZE_MAX) && numbers.data == NULL);
}

static void copies_keep_what_they_need(void)
{
  std_msgs__msg__String__Sequence * few = std_msgs__msg__String__Sequence__create(1);
  std_msgs__msg__String__Sequence * many = std_msgs__msg__String__Sequence__create(4);
  CHECK(few && many);
  CHECK(rosidl_runtime_c__String__assign(&few->data[0].data, "first"));
  CHECK(std_msgs__msg__String__Sequence__copy(few, many));
  CHECK(many->size == 1 && many->capacity == 4 && std_msgs__msg__String__Sequence__are_equal(few, many));
  many->size = 3;
  CHECK(strcmp(many->data[2].data.data, "") == 0);
  CHECK(std_msgs__msg__String__Sequence__copy(many, few) && few->size == 3 && few->capacity == 3);
  CHECK(std_msgs__msg__String__Sequence__copy(few, few) && few->size == 3);
  CHECK(std_msgs__msg__String__Sequence__are_equal(few, many));
  CHECK(!std_msgs__msg__String__Sequence__create(SIZE_MAX));
  std_msgs__msg__String__Sequence__destroy(few);
  std_msgs__msg__String__Sequence__destroy(many);
  std_msgs__msg__String__Sequence__destroy(NULL);
}

static void null_is_refused(void)
{
  std_msgs__msg__String message;
  CHECK(std_msgs__msg__String__init(&message) && !std_msgs__msg__String__init(NULL));
  CHECK(!std_msgs__msg__String__copy(NULL, &message) && !std_msgs__msg__String__copy(&message, NULL));
  CHECK(!std_msgs__msg__String__are_equal(NULL, &message) && !std_msgs__msg__String__are_equal(&message, NULL));
  CHECK(std_msgs__msg__String__copy(&message, &message));
  CHECK(!rosidl_runtime_c__int8__Sequence__copy(NULL, NULL) && !rosidl_runtime_c__String__copy(NULL, NULL));
  CHECK(!std_msgs__msg__String__Sequence__init(NULL, 1) && !rosidl_runtime_c__int8__Sequence__init(NULL, 1));
  std_msgs__msg__String__fini(NULL);
  std_msgs__msg__String__destroy(NULL);
  std_msgs__msg__String__fini(&message);
}

static void hashes_are_written_and_read(void)
{
  static const char text[] = "RIHS01_000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1eff";
  rosidl_type_hash_t hash = rosidl_get_zero_initialized_type_hash();
  CHECK(hash.version == ROSIDL_TYPE_HASH_VERSION_UNSET && hash.value[31] == 0);
  CHECK(forge_read_type_hash(text, &hash) && hash.version == 1 && hash.value[30] == 30 && hash.value[31] == 255);
  char written[FORGE_TYPE_HASH_TEXT_SIZE + 1];
  forge_write_type_hash(&hash, written);
  CHECK(strcmp(written, text) == 0);
  CHECK(!forge_read_type_hash("RIHS02_00", &hash) && hash.version == 2);
  CHECK(!forge_read_type_hash("RIHS0", &hash) && !forge_read_type_hash("SHA01_00", &hash));
  written[20] = 'g';
  CHECK(!forge_read_type_hash(written, &hash) && hash.version == 1);
}

static void descriptions_are_messages(void)
{
  rosidl_runtime_c__type_description__TypeDescription * one =
    rosidl_runtime_c__type_description__TypeDescription__create();
  rosidl_runtime_c__type_description__TypeDescription * two =
    rosidl_runtime_c__type_description__TypeDescription__create();
  CHECK(one && two && rosidl_runtime_c__type_description__TypeDescription__are_equal(one, two));
  CHECK(rosidl_runtime_c__type_description__Field__Sequence__init(&one->type_description.fields, 2));
  one->type_description.fields.data[1].type.capacity = 7;
  CHECK(rosidl_runtime_c__String__assign(&one->type_description.fields.data[0].default_value, "1"));
  CHECK(!rosidl_runtime_c__type_description__TypeDescription__are_equal(one, two));
  CHECK(rosidl_runtime_c__type_description__TypeDescription__copy(one, two));
  CHECK(two->type_description.fields.data[1].type.capacity == 7);
  CHECK(rosidl_runtime_c__type_description__TypeDescription__are_equal(one, two));
  CHECK(!rosidl_runtime_c__type_description__KeyValue__are_equal(NULL, NULL));
  rosidl_runtime_c__type_description__TypeDescription__destroy(one);
  rosidl_runtime_c__type_description__TypeDescription__destroy(two);
}

static void bounds_are_found_by_identifier(void)
{
  const rosidl_runtime_c__Sequence__bound bound = {"mine", NULL, get_sequence_bound_handle_function};
  CHECK(get_sequence_bound_handle(&bound, "mine") == &bound && !get_sequence_bound_handle(&bound, "other"));
}

static void services_and_actions_have_their_parts(void)
{
  std_srvs__srv__SetBool_Request request;
  std_srvs__srv__SetBool_Response * response = std_srvs__srv__SetBool_Response__create();
  CHECK(std_srvs__srv__SetBool_Request__init(&request) && !request.data && response);
  std_srvs__srv__SetBool_Response__destroy(response);
  example_interfaces__action__Fibonacci_GetResult_Response result;
  CHECK(example_interfaces__action__Fibonacci_GetResult_Response__init(&result));
  CHECK(rosidl_runtime_c__int32__Sequence__init(&result.result.sequence, 5));
  example_interfaces__action__Fibonacci_GetResult_Response__fini(&result);
  example_interfaces__action__Fibonacci_SendGoal_Request goal;
  CHECK(example_interfaces__action__Fibonacci_SendGoal_Request__init(&goal));
  CHECK(sizeof(goal.goal_id.uuid) == 16 && goal.goal.order == 0);
}

/* Make a message with something in every member, or fail. */
static bool nest_is_filled(probe__msg__Nest * message)
{
  if (!probe__msg__Nest__init(message)) {
    return false;
  }
  const probe__msg__Defaults__Sequence one = {&message->one, 1, 1};
  return probe__msg__Defaults__Sequence__copy(&one, &message->few) &&
         probe__msg__Defaults__Sequence__copy(&message->few, &message->any) &&
         probe__msg__Empty__Sequence__init(&message->nothing, 3);
}

/* Whatever allocation fails, nothing leaks, nothing is freed twice, and the answer is false. */
static void memory_may_run_out(void)
{
  size_t needed = 0;
  bool done = false;
  for (; !done && needed < 1000; ++needed) {
    memory_left = needed;
    probe__msg__Nest message;
    memset(&message, 0, sizeof(message));
    probe__msg__Nest copy;
    memset(&copy, 0, sizeof(copy));
    done = nest_is_filled(&message) && probe__msg__Nest__copy(&message, &copy);
    if (done) {
      CHECK(probe__msg__Nest__are_equal(&message, &copy) && copy.any.size == 1);
    }
    probe__msg__Nest__fini(&copy);
    probe__msg__Nest__fini(&message);
    memory_left = needed;
    probe__msg__Nest__Sequence * both = probe__msg__Nest__Sequence__create(2);
    probe__msg__Nest__Sequence__destroy(both);
    memory_left = needed;
    probe__msg__Wide__destroy(probe__msg__Wide__create());
    rosidl_runtime_c__U16String text;
    memset(&text, 0, sizeof(text));
    memory_left = needed % 2;
    CHECK(rosidl_runtime_c__U16String__resize(&text, 2) == (needed % 2 == 1));
    memory_left = needed % 2;
    CHECK(rosidl_runtime_c__U16String__assignn_from_char(&text, "abcdefgh", 8) == (needed % 2 == 1));
    rosidl_runtime_c__U16String__fini(&text);
    memory_left = SIZE_MAX;
  }
  CHECK(done && needed > 50);
}

static void handles_name_their_types(void)
{
  const rosidl_message_type_support_t * message = ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, String);
  CHECK(strcmp((const char *)message->data, "std_msgs/msg/String") == 0);
  CHECK(message->func(message, message->typesupport_identifier) == message);
  CHECK(get_message_typesupport_handle(message, "rosidl_typesupport_introspection_c") == NULL);

  const rosidl_service_type_support_t * service = ROSIDL_GET_SRV_TYPE_SUPPORT(std_srvs, srv, SetBool);
  CHECK(strcmp((const char *)service->data, "std_srvs/srv/SetBool") == 0);
  CHECK(get_service_typesupport_handle(service, FORGE_TYPESUPPORT_C) == service);
  CHECK(get_service_typesupport_handle(service, "unknown") == NULL);

  const rosidl_action_type_support_t * action =
    ROSIDL_GET_ACTION_TYPE_SUPPORT(example_interfaces, Fibonacci);
  const char * goal = (const char *)action->goal_service_type_support->data;
  CHECK(strcmp(goal, "example_interfaces/action/Fibonacci_SendGoal") == 0);
  const char * result = (const char *)action->result_service_type_support->data;
  CHECK(strcmp(result, "example_interfaces/action/Fibonacci_GetResult") == 0);
  const char * feedback = (const char *)action->feedback_message_type_support->data;
  CHECK(strcmp(feedback, "example_interfaces/action/Fibonacci_FeedbackMessage") == 0);
  CHECK(strcmp((const char *)action->cancel_service_type_support->data, "action_msgs/srv/CancelGoal") == 0);
  CHECK(strcmp((const char *)action->status_message_type_support->data, "action_msgs/msg/GoalStatusArray") == 0);
}

int main(void)
{
  texts_are_made_and_given_back();
  a_text_grows_out_of_itself();
  wide_texts_count_units();
  members_have_their_defaults();
  types_of_idl_only_have_theirs();
  constants_are_constant();
  sequences_are_filled_as_ros_programs_do();
  copies_keep_what_they_need();
  null_is_refused();
  hashes_are_written_and_read();
  descriptions_are_messages();
  bounds_are_found_by_identifier();
  services_and_actions_have_their_parts();
  memory_may_run_out();
  handles_name_their_types();
  return failures == 0 ? 0 : 1;
}
