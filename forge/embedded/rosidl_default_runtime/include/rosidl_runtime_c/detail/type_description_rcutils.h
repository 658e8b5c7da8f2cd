#ifndef ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_RCUTILS_H_
#define ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_RCUTILS_H_

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "rcutils/allocator.h"
#include "rcutils/repl_str.h"
#include "rcutils/types/hash_map.h"
#include "rcutils/types/rcutils_ret.h"
#include "rosidl_runtime_c/detail/type_description.h"

#ifdef __cplusplus
extern "C"
{
#endif

#define FORGE_TD(NAME) rosidl_runtime_c_type_description_utils_ ## NAME

typedef rosidl_runtime_c__type_description__Field forge_td_field;
typedef rosidl_runtime_c__type_description__Field__Sequence forge_td_fields;
typedef rosidl_runtime_c__type_description__IndividualTypeDescription forge_td_type;
typedef rosidl_runtime_c__type_description__IndividualTypeDescription__Sequence forge_td_types;
typedef rosidl_runtime_c__type_description__TypeDescription forge_td_description;

/* Type ids of arrays, bounded and unbounded sequences are those of their elements plus a multiple of this. */
static const uint8_t FORGE_TD(SEQUENCE_TYPE_ID_MASK) = 48;

static inline bool forge_td_is_nested(const forge_td_field * field)
{
  return field->type.type_id % 48 == 1;
}

/* Find a field by name. `*field` is NULL before. */
static inline rcutils_ret_t FORGE_TD(find_field)(
  const forge_td_fields * fields, const char * name, forge_td_field ** field)
{
  if (!fields || !name || !field || *field) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  for (size_t i = 0; i < fields->size; ++i) {
    if (strcmp(fields->data[i].name.data, name) == 0) {
      *field = &fields->data[i];
      return RCUTILS_RET_OK;
    }
  }
  return RCUTILS_RET_NOT_FOUND;
}

/* Find a type by name. `*referenced_type` is NULL before. */
static inline rcutils_ret_t FORGE_TD(find_referenced_type_description)(
  const forge_td_types * referenced_types, const char * type_name, forge_td_type ** referenced_type)
{
  if (!referenced_types || !type_name || !referenced_type || *referenced_type) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  for (size_t i = 0; i < referenced_types->size; ++i) {
    if (strcmp(referenced_types->data[i].type_name.data, type_name) == 0) {
      *referenced_type = &referenced_types->data[i];
      return RCUTILS_RET_OK;
    }
  }
  return RCUTILS_RET_NOT_FOUND;
}

/* Finalize a map and free it. */
static inline void forge_td_delete_map(rcutils_hash_map_t ** map, const rcutils_allocator_t * allocator)
{
  if (*map && rcutils_hash_map_fini(*map) == RCUTILS_RET_OK) {
    allocator->deallocate(*map, allocator->state);
  }
  *map = NULL;
}

/* Allocate an empty map from names to pointers. */
static inline rcutils_ret_t forge_td_new_map(
  size_t size, const rcutils_allocator_t * allocator, rcutils_hash_map_t ** map)
{
  if (!rcutils_allocator_is_valid(allocator) || !map || *map) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  rcutils_hash_map_t * made =
    (rcutils_hash_map_t *)allocator->allocate(sizeof(*made), allocator->state);
  if (!made) {
    return RCUTILS_RET_BAD_ALLOC;
  }
  size_t capacity = 1;
  while (capacity < size) {
    capacity *= 2;
  }
  *made = rcutils_get_zero_initialized_hash_map();
  const rcutils_ret_t result = rcutils_hash_map_init(
    made, capacity, sizeof(char *), sizeof(void *), rcutils_hash_map_string_hash_func,
    rcutils_hash_map_string_cmp_func, allocator);
  if (result != RCUTILS_RET_OK) {
    allocator->deallocate(made, allocator->state);
    return result;
  }
  *map = made;
  return RCUTILS_RET_OK;
}

/* Make a map from names to the fields of a type. */
static inline rcutils_ret_t FORGE_TD(get_field_map)(
  const forge_td_type * individual_description, const rcutils_allocator_t * allocator,
  rcutils_hash_map_t ** hash_map)
{
  if (!individual_description) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  const forge_td_fields * fields = &individual_description->fields;
  rcutils_ret_t result = forge_td_new_map(fields->size, allocator, hash_map);
  for (size_t i = 0; result == RCUTILS_RET_OK && i < fields->size; ++i) {
    forge_td_field * field = &fields->data[i];
    result = rcutils_hash_map_set(*hash_map, &field->name.data, &field);
    if (result != RCUTILS_RET_OK) {
      forge_td_delete_map(hash_map, allocator);
    }
  }
  return result;
}

/* Make a map from names to types; types of the same name must be equal. */
static inline rcutils_ret_t FORGE_TD(get_referenced_type_description_map)(
  const forge_td_types * referenced_types, const rcutils_allocator_t * allocator,
  rcutils_hash_map_t ** hash_map)
{
  if (!referenced_types) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  rcutils_ret_t result = forge_td_new_map(referenced_types->size, allocator, hash_map);
  for (size_t i = 0; result == RCUTILS_RET_OK && i < referenced_types->size; ++i) {
    forge_td_type * type = &referenced_types->data[i];
    forge_td_type * other = type;
    if (rcutils_hash_map_key_exists(*hash_map, &type->type_name.data)) {
      result = rcutils_hash_map_get(*hash_map, &type->type_name.data, &other);
    }
    if (result == RCUTILS_RET_OK &&
      !rosidl_runtime_c__type_description__IndividualTypeDescription__are_equal(type, other))
    {
      result = RCUTILS_RET_INVALID_ARGUMENT;
    }
    if (result == RCUTILS_RET_OK) {
      result = rcutils_hash_map_set(*hash_map, &type->type_name.data, &type);
    }
    if (result != RCUTILS_RET_OK) {
      forge_td_delete_map(hash_map, allocator);
    }
  }
  return result;
}

/* Add the types that a type refers to, directly or indirectly. */
static inline rcutils_ret_t forge_td_add_necessary(
  const forge_td_type * type, const rcutils_hash_map_t * types, rcutils_hash_map_t * seen)
{
  for (size_t i = 0; i < type->fields.size; ++i) {
    const forge_td_field * field = &type->fields.data[i];
    const void * name = &field->type.nested_type_name.data;
    if (!forge_td_is_nested(field) || rcutils_hash_map_key_exists(seen, name)) {
      continue;
    }
    forge_td_type * nested = NULL;
    rcutils_ret_t result = rcutils_hash_map_get(types, name, &nested);
    if (result == RCUTILS_RET_OK) {
      result = rcutils_hash_map_set(seen, &nested->type_name.data, &nested);
    }
    if (result == RCUTILS_RET_OK) {
      result = forge_td_add_necessary(nested, types, seen);
    }
    if (result != RCUTILS_RET_OK) {
      return result;
    }
  }
  return RCUTILS_RET_OK;
}

/* Add to a map, or to a new one if `*seen_map` is NULL, what a type refers to, directly or indirectly. */
static inline rcutils_ret_t FORGE_TD(get_necessary_referenced_type_descriptions_map)(
  const forge_td_type * main_type_description, const rcutils_hash_map_t * referenced_types_map,
  const rcutils_allocator_t * allocator, rcutils_hash_map_t ** seen_map)
{
  size_t size = 0;
  if (!main_type_description || !referenced_types_map || !seen_map ||
    rcutils_hash_map_get_size(referenced_types_map, &size) != RCUTILS_RET_OK)
  {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  const bool is_new = !*seen_map;
  rcutils_ret_t result = is_new ? forge_td_new_map(size, allocator, seen_map) : RCUTILS_RET_OK;
  if (result == RCUTILS_RET_OK) {
    result = forge_td_add_necessary(main_type_description, referenced_types_map, *seen_map);
    if (result != RCUTILS_RET_OK && is_new) {
      forge_td_delete_map(seen_map, allocator);
    }
  }
  return result;
}

/* Compare types by name, for qsort(). */
static inline int FORGE_TD(referenced_type_description_sequence_sort_compare)(
  const void * lhs, const void * rhs)
{
  return strcmp(
    ((const forge_td_type *)lhs)->type_name.data, ((const forge_td_type *)rhs)->type_name.data);
}

/* Sort types by name. */
static inline rcutils_ret_t FORGE_TD(sort_referenced_type_descriptions_in_place)(forge_td_types * sequence)
{
  if (!sequence) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  if (sequence->size > 1) {
    qsort(
      sequence->data, sequence->size, sizeof(*sequence->data),
      FORGE_TD(referenced_type_description_sequence_sort_compare));
  }
  return RCUTILS_RET_OK;
}

/* Make a sequence of copies of the types in a map. `*sequence` is NULL before. */
static inline rcutils_ret_t
FORGE_TD(copy_init_sequence_from_referenced_type_descriptions_map)(
  const rcutils_hash_map_t * hash_map, forge_td_types ** sequence, bool sort)
{
  size_t size = 0;
  if (!hash_map || !sequence || *sequence ||
    rcutils_hash_map_get_size(hash_map, &size) != RCUTILS_RET_OK)
  {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  forge_td_types * made =
    rosidl_runtime_c__type_description__IndividualTypeDescription__Sequence__create(size);
  if (!made) {
    return RCUTILS_RET_BAD_ALLOC;
  }
  const char * name = NULL;
  forge_td_type * type = NULL;
  for (size_t i = 0; i < size; ++i) {
    const rcutils_ret_t result =
      rcutils_hash_map_get_next_key_and_data(hash_map, i ? &name : NULL, &name, &type);
    if (result != RCUTILS_RET_OK ||
      !rosidl_runtime_c__type_description__IndividualTypeDescription__copy(type, &made->data[i]))
    {
      rosidl_runtime_c__type_description__IndividualTypeDescription__Sequence__destroy(made);
      return result == RCUTILS_RET_OK ? RCUTILS_RET_BAD_ALLOC : result;
    }
  }
  *sequence = made;
  return sort ? FORGE_TD(sort_referenced_type_descriptions_in_place)(made) : RCUTILS_RET_OK;
}

/* Remove the types that another type does not refer to; the order may change. */
static inline rcutils_ret_t FORGE_TD(prune_referenced_type_descriptions_in_place)(
  const forge_td_type * main_type_description, forge_td_types * referenced_types)
{
  const rcutils_allocator_t allocator = rcutils_get_default_allocator();
  rcutils_hash_map_t * types = NULL;
  rcutils_hash_map_t * necessary = NULL;
  forge_td_types * kept = NULL;
  rcutils_ret_t result =
    FORGE_TD(get_referenced_type_description_map)(referenced_types, &allocator, &types);
  if (result == RCUTILS_RET_OK) {
    result = FORGE_TD(get_necessary_referenced_type_descriptions_map)(
      main_type_description, types, &allocator, &necessary);
  }
  if (result == RCUTILS_RET_OK) {
    result = FORGE_TD(copy_init_sequence_from_referenced_type_descriptions_map)(necessary, &kept, false);
  }
  forge_td_delete_map(&necessary, &allocator);
  forge_td_delete_map(&types, &allocator);
  if (result == RCUTILS_RET_OK) {
    const forge_td_types old = *referenced_types;
    *referenced_types = *kept;
    *kept = old;
    rosidl_runtime_c__type_description__IndividualTypeDescription__Sequence__destroy(kept);
  }
  return result;
}

/* A field needs a name, a type, and the name of the type if it is nested. */
static inline rcutils_ret_t FORGE_TD(field_is_valid)(const forge_td_field * field)
{
  const bool valid = field && field->name.size > 0 && field->type.type_id != 0 &&
    (!forge_td_is_nested(field) || field->type.nested_type_name.size > 0);
  return valid ? RCUTILS_RET_OK : RCUTILS_RET_INVALID_ARGUMENT;
}

/* A type needs a name and valid fields with different names. */
static inline rcutils_ret_t FORGE_TD(individual_type_description_is_valid)(const forge_td_type * description)
{
  bool valid = description && description->type_name.size > 0;
  for (size_t i = 0; valid && i < description->fields.size; ++i) {
    const forge_td_field * field = &description->fields.data[i];
    forge_td_field * first = NULL;
    valid = FORGE_TD(field_is_valid)(field) == RCUTILS_RET_OK &&
      FORGE_TD(find_field)(&description->fields, field->name.data, &first) == RCUTILS_RET_OK &&
      first == field;
  }
  return valid ? RCUTILS_RET_OK : RCUTILS_RET_INVALID_ARGUMENT;
}

/* A description needs valid types, sorted: those that the main one refers to, and no others. */
static inline rcutils_ret_t FORGE_TD(type_description_is_valid)(const forge_td_description * description)
{
  if (!description) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  const forge_td_types * types = &description->referenced_type_descriptions;
  rcutils_ret_t result =
    FORGE_TD(individual_type_description_is_valid)(&description->type_description);
  for (size_t i = 0; result == RCUTILS_RET_OK && i < types->size; ++i) {
    result = FORGE_TD(individual_type_description_is_valid)(&types->data[i]);
    if (i > 0 && strcmp(types->data[i - 1].type_name.data, types->data[i].type_name.data) >= 0) {
      result = RCUTILS_RET_INVALID_ARGUMENT;
    }
  }
  if (result != RCUTILS_RET_OK) {
    return result;
  }
  const rcutils_allocator_t allocator = rcutils_get_default_allocator();
  rcutils_hash_map_t * all = NULL;
  rcutils_hash_map_t * necessary = NULL;
  size_t size = 0;
  result = FORGE_TD(get_referenced_type_description_map)(types, &allocator, &all);
  if (result == RCUTILS_RET_OK) {
    result = FORGE_TD(get_necessary_referenced_type_descriptions_map)(
      &description->type_description, all, &allocator, &necessary);
  }
  if (result == RCUTILS_RET_OK) {
    result = rcutils_hash_map_get_size(necessary, &size);
  }
  forge_td_delete_map(&necessary, &allocator);
  forge_td_delete_map(&all, &allocator);
  return result == RCUTILS_RET_OK && size != types->size ? RCUTILS_RET_INVALID_ARGUMENT : result;
}

/* Remove unnecessary types and sort the others. */
static inline rcutils_ret_t FORGE_TD(coerce_to_valid_type_description_in_place)(
  forge_td_description * type_description)
{
  if (!type_description) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  const rcutils_ret_t result = FORGE_TD(prune_referenced_type_descriptions_in_place)(
    &type_description->type_description, &type_description->referenced_type_descriptions);
  if (result != RCUTILS_RET_OK) {
    return result;
  }
  FORGE_TD(sort_referenced_type_descriptions_in_place)(&type_description->referenced_type_descriptions);
  return FORGE_TD(type_description_is_valid)(type_description);
}

/* Create a field. `*field` is NULL before. */
static inline rcutils_ret_t FORGE_TD(create_field)(
  const char * name, size_t name_length, uint8_t type_id, uint64_t capacity, uint64_t string_capacity,
  const char * nested_type_name, size_t nested_type_name_length,
  const char * default_value, size_t default_value_length, forge_td_field ** field)
{
  if (!name || !nested_type_name || !default_value || !field || *field) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  forge_td_field * made = rosidl_runtime_c__type_description__Field__create();
  if (!made ||
    !rosidl_runtime_c__String__assignn(&made->name, name, name_length) ||
    !rosidl_runtime_c__String__assignn(
      &made->type.nested_type_name, nested_type_name, nested_type_name_length) ||
    !rosidl_runtime_c__String__assignn(&made->default_value, default_value, default_value_length))
  {
    rosidl_runtime_c__type_description__Field__destroy(made);
    return RCUTILS_RET_BAD_ALLOC;
  }
  made->type.type_id = type_id;
  made->type.capacity = capacity;
  made->type.string_capacity = string_capacity;
  *field = made;
  return RCUTILS_RET_OK;
}

/* Create a type without fields. `*individual_description` is NULL before. */
static inline rcutils_ret_t FORGE_TD(create_individual_type_description)(
  const char * type_name, size_t type_name_length, forge_td_type ** individual_description)
{
  if (!type_name || !individual_description || *individual_description) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  forge_td_type * made = rosidl_runtime_c__type_description__IndividualTypeDescription__create();
  if (!made || !rosidl_runtime_c__String__assignn(&made->type_name, type_name, type_name_length)) {
    rosidl_runtime_c__type_description__IndividualTypeDescription__destroy(made);
    return RCUTILS_RET_BAD_ALLOC;
  }
  *individual_description = made;
  return RCUTILS_RET_OK;
}

/* Create a description without fields and types. `*type_description` is NULL before. */
static inline rcutils_ret_t FORGE_TD(create_type_description)(
  const char * type_name, size_t type_name_length, forge_td_description ** type_description)
{
  if (!type_name || !type_description || *type_description) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  forge_td_description * made = rosidl_runtime_c__type_description__TypeDescription__create();
  if (!made ||
    !rosidl_runtime_c__String__assignn(&made->type_description.type_name, type_name, type_name_length))
  {
    rosidl_runtime_c__type_description__TypeDescription__destroy(made);
    return RCUTILS_RET_BAD_ALLOC;
  }
  *type_description = made;
  return RCUTILS_RET_OK;
}

/* Append a copy of a field. */
static inline rcutils_ret_t FORGE_TD(append_field)(
  forge_td_type * individual_type_description, forge_td_field * field)
{
  if (!individual_type_description || !field) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  forge_td_fields * fields = &individual_type_description->fields;
  if (!rosidl_runtime_c__type_description__Field__Sequence__grow(fields, fields->size + 1) ||
    !rosidl_runtime_c__type_description__Field__copy(field, &fields->data[fields->size]))
  {
    return RCUTILS_RET_BAD_ALLOC;
  }
  ++fields->size;
  return RCUTILS_RET_OK;
}

/* Append a copy of a type. */
static inline rcutils_ret_t FORGE_TD(append_referenced_individual_type_description)(
  forge_td_description * type_description, forge_td_type * referenced_type_description, bool sort)
{
  if (!type_description || !referenced_type_description) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  forge_td_types * types = &type_description->referenced_type_descriptions;
  if (!rosidl_runtime_c__type_description__IndividualTypeDescription__Sequence__grow(
      types, types->size + 1) ||
    !rosidl_runtime_c__type_description__IndividualTypeDescription__copy(
      referenced_type_description, &types->data[types->size]))
  {
    return RCUTILS_RET_BAD_ALLOC;
  }
  ++types->size;
  return sort ? FORGE_TD(sort_referenced_type_descriptions_in_place)(types) : RCUTILS_RET_OK;
}

/* Append copies of the type of another description and of all types that it refers to. */
static inline rcutils_ret_t FORGE_TD(append_referenced_type_description)(
  forge_td_description * type_description, forge_td_description * type_description_to_append,
  bool coerce_to_valid)
{
  if (!type_description || !type_description_to_append) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  const forge_td_types * more = &type_description_to_append->referenced_type_descriptions;
  rcutils_ret_t result = FORGE_TD(append_referenced_individual_type_description)(
    type_description, &type_description_to_append->type_description, false);
  for (size_t i = 0; result == RCUTILS_RET_OK && i < more->size; ++i) {
    result = FORGE_TD(append_referenced_individual_type_description)(
      type_description, &more->data[i], false);
  }
  if (result == RCUTILS_RET_OK && coerce_to_valid &&
    FORGE_TD(coerce_to_valid_type_description_in_place)(type_description) != RCUTILS_RET_OK)
  {
    return RCUTILS_RET_WARN;
  }
  return result;
}

/* Create a description of a type from copies. `*output_description` is NULL before. */
static inline rcutils_ret_t
FORGE_TD(get_referenced_type_description_as_type_description)(
  const forge_td_types * referenced_descriptions, const forge_td_type * referenced_description,
  forge_td_description ** output_description, bool coerce_to_valid)
{
  if (!referenced_descriptions || !referenced_description || !output_description || *output_description) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  forge_td_description * made = rosidl_runtime_c__type_description__TypeDescription__create();
  rcutils_ret_t result = RCUTILS_RET_BAD_ALLOC;
  if (made &&
    rosidl_runtime_c__type_description__IndividualTypeDescription__copy(
      referenced_description, &made->type_description) &&
    rosidl_runtime_c__type_description__IndividualTypeDescription__Sequence__copy(
      referenced_descriptions, &made->referenced_type_descriptions))
  {
    result = coerce_to_valid ? FORGE_TD(coerce_to_valid_type_description_in_place)(made) : RCUTILS_RET_OK;
  }
  if (result != RCUTILS_RET_OK) {
    rosidl_runtime_c__type_description__TypeDescription__destroy(made);
    return result;
  }
  *output_description = made;
  return RCUTILS_RET_OK;
}

/* Replace a part of a name wherever it occurs. */
static inline bool forge_td_replace(rosidl_runtime_c__String * name, const char * from, const char * to)
{
  const rcutils_allocator_t allocator = rcutils_get_default_allocator();
  char * text = rcutils_repl_str(name->data, from, to, &allocator);
  const bool done = text && rosidl_runtime_c__String__assign(name, text);
  allocator.deallocate(text, allocator.state);
  return done;
}

/* Replace a part of the names of a type and of the types of its fields. */
static inline rcutils_ret_t
FORGE_TD(repl_individual_type_description_type_names_in_place)(
  forge_td_type * individual_type_description, const char * from, const char * to)
{
  if (!individual_type_description || !from || !to) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  bool done = forge_td_replace(&individual_type_description->type_name, from, to);
  for (size_t i = 0; done && i < individual_type_description->fields.size; ++i) {
    rosidl_runtime_c__String * name = &individual_type_description->fields.data[i].type.nested_type_name;
    done = name->size == 0 || forge_td_replace(name, from, to);
  }
  return done ? RCUTILS_RET_OK : RCUTILS_RET_ERROR;
}

/* Replace a part of all names of types. */
static inline rcutils_ret_t FORGE_TD(repl_all_type_description_type_names_in_place)(
  forge_td_description * type_description, const char * from, const char * to)
{
  if (!type_description) {
    return RCUTILS_RET_INVALID_ARGUMENT;
  }
  forge_td_types * types = &type_description->referenced_type_descriptions;
  rcutils_ret_t result = FORGE_TD(repl_individual_type_description_type_names_in_place)(
    &type_description->type_description, from, to);
  for (size_t i = 0; result == RCUTILS_RET_OK && i < types->size; ++i) {
    result = FORGE_TD(repl_individual_type_description_type_names_in_place)(&types->data[i], from, to);
  }
  return result;
}

#ifdef __cplusplus
}
#endif

#endif  /* ROSIDL_RUNTIME_C__DETAIL__TYPE_DESCRIPTION_RCUTILS_H_ */
