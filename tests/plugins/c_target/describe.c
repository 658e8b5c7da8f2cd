// Prints the type descriptions that the generated headers contain, one line per type, field and text.

#include <stdio.h>

#include "probe/action/walk.h"
#include "probe/msg/everything.h"
#include "probe/srv/move.h"

static void print_type(const rosidl_runtime_c__type_description__IndividualTypeDescription * type)
{
  printf("type %s\n", type->type_name.data);
  for (size_t i = 0; i < type->fields.size; ++i) {
    const rosidl_runtime_c__type_description__Field * field = &type->fields.data[i];
    printf("field %s %u %u %u '%s' '%s'\n", field->name.data, field->type.type_id,
      (unsigned)field->type.capacity, (unsigned)field->type.string_capacity,
      field->type.nested_type_name.data, field->default_value.data);
  }
}

static void print(
  const rosidl_type_hash_t * hash,
  const rosidl_runtime_c__type_description__TypeDescription * description,
  const rosidl_runtime_c__type_description__TypeSource__Sequence * sources)
{
  char text[FORGE_TYPE_HASH_TEXT_SIZE + 1];
  forge_write_type_hash(hash, text);
  printf("hash %s\n", text);
  print_type(&description->type_description);
  for (size_t i = 0; i < description->referenced_type_descriptions.size; ++i) {
    print_type(&description->referenced_type_descriptions.data[i]);
  }
  for (size_t i = 0; i < sources->size; ++i) {
    const rosidl_runtime_c__type_description__TypeSource * source = &sources->data[i];
    printf("source %s %s %u\n", source->type_name.data, source->encoding.data,
      (unsigned)source->raw_file_contents.size);
  }
}

#define PRINT(TYPE) \
  print(TYPE ## __get_type_hash(NULL), TYPE ## __get_type_description(NULL), \
    TYPE ## __get_type_description_sources(NULL))

int main(void)
{
  PRINT(probe__msg__Everything);
  PRINT(probe__srv__Move);
  PRINT(probe__srv__Move_Event);
  PRINT(probe__action__Walk);
  PRINT(probe__action__Walk_GetResult);
  fputs(probe__msg__Everything__get_individual_type_description_source(NULL)->raw_file_contents.data, stdout);
  return 0;
}
