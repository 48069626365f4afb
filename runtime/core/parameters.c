#include "floating_point.h"

#include "parameters.h"

#include <string.h>

#include "pseudo_inverse.h"

/* --- paths -------------------------------------------------------------------------------------------------------- */

/* an index by its letter in the path of a row */
static uint32_t index_of(const model_item* item, uint32_t offset, char letter) {
  switch (letter) {
    case 'i': return item->tendon + 1;
    case 'j': return item->joint + 1;
    case 'd': return item->point + 1;
    default: return offset + 1;
  }
}

/* writes what stands for %letter in the path of a row (key_row) */
static void write_part(message_line path, const model_item* item, uint32_t offset, char letter) {
  if (letter == '~') {
    message_add(path, "%s", item->law != LAW_ASYMMETRIC ? "" : offset < 4 ? ".positive" : ".negative");
  } else if (letter != '@') {
    message_add(path, "%zu", (size_t)index_of(item, offset, letter));
  } else if (item->has_angles) {
    message_add(path, ".laws[%zu]", (size_t)item->point + 1);
  }
}

static void write_path(message_line path, const model_item* item, uint32_t offset, const char* pattern) {
  char plain[PARAMETER_PATH_BYTES];
  while (*pattern) {
    const size_t length = strcspn(pattern, "%");
    memcpy(plain, pattern, length);
    plain[length] = '\0';
    message_add(path, "%s", plain);
    pattern += length;
    if (*pattern) {
      write_part(path, item, offset, pattern[1]);
      pattern += 2;
    }
  }
}

void parameter_path(const model_item* item, uint32_t index, char* path) {
  const message_line line = {path, PARAMETER_PATH_BYTES};
  const uint32_t offset = index - item->first;
  path[0] = 0;
  if (item->kind != ITEM_EXTENSION) {
    write_path(line, item, offset, key_row_of(item->kind, offset)->path);
    return;
  }
  message_add(line, "extensions[%zu].%s", (size_t)item->extension + 1, item->effect->parameters[offset].name);
}

typedef struct search {
  const char* path;
  uint32_t index;
  model_item item;
} search;

static int match_path(void* context, const model_item* item) {
  search* s = context;
  char path[PARAMETER_PATH_BYTES];
  for (uint32_t i = 0; i < item->count; ++i) {
    parameter_path(item, item->first + i, path);
    if (strcmp(path, s->path) == 0) {
      s->index = item->first + i;
      return 1;
    }
  }
  return 0;
}

uint32_t parameter_find(const model_shape* shape, const char* path) {
  search s = {.path = path, .index = shape->parameter_count};
  model_visit(shape, match_path, &s);
  return s.index;
}

static int match_index(void* context, const model_item* item) {
  search* s = context;
  s->item = *item;
  return s->index < item->first + item->count;
}

model_item parameter_item(const model_shape* shape, uint32_t index) {
  search s = {.index = index};
  model_visit(shape, match_index, &s);
  return s.item;
}

/* --- ranges ------------------------------------------------------------------------------------------------------- */

static parameter_range range_of_effect(const model_item* item, uint32_t offset) {
  const effect_parameter* p = &item->effect->parameters[offset];
  const int at_joint = item->place.joint != EFFECT_NOWHERE && item->place.tendon == EFFECT_NOWHERE;
  const char* elsewhere = at_joint ? p->unit_at_joint : is_everywhere(item->place) ? p->unit_everywhere : NULL;
  return (parameter_range){elsewhere ? elsewhere : p->unit, p->minimum, p->maximum, p->above_minimum, 1};
}

parameter_range parameter_range_of(const model_item* item, uint32_t index) {
  const uint32_t offset = index - item->first;
  if (item->kind == ITEM_EXTENSION) {
    return range_of_effect(item, offset);
  }
  const key_row* row = key_row_of(item->kind, offset);
  return (parameter_range){row->unit, row->minimum, row->maximum, row->above_minimum, row->tunable};
}

/* --- checks ------------------------------------------------------------------------------------------------------- */

/* "<path> = <value>" */
static void say_value(message_line message, const model_item* item, uint32_t index, double value) {
  char path[PARAMETER_PATH_BYTES];
  parameter_path(item, index, path);
  message_write(message, "%s = %g", path, value);
}

void parameter_say_range(const model_item* item, uint32_t index, message_line message) {
  const parameter_range range = parameter_range_of(item, index);
  message_add(message, range.above_minimum ? "above %g and at most %g %s" : "%g to %g %s", range.minimum, range.maximum,
              range.unit);
}

int parameter_check_value(const model_item* item, uint32_t index, double value, message_line message) {
  const parameter_range range = parameter_range_of(item, index);
  if (value <= range.maximum && (range.above_minimum ? value > range.minimum : value >= range.minimum)) {
    return 0;
  }
  say_value(message, item, index, value);
  message_add(message, ": expected ");
  parameter_say_range(item, index, message);
  return -1;
}

typedef struct check {
  const double* values;
  message_line message;
  model_item threshold; /* of the two velocity thresholds one that is 0; count 0: none */
} check;

static int check_range(void* context, const model_item* item) {
  const check* c = context;
  for (uint32_t i = item->first; i < item->first + item->count; ++i) {
    if (parameter_check_value(item, i, c->values[i], c->message)) {
      return -1;
    }
  }
  return 0;
}

static int check_law(const check* c, const model_item* item) {
  for (uint32_t i = item->first; i < item->first + item->count; i += 4) {
    if (c->values[i] < c->values[i + 1]) {
      say_value(c->message, item, i, c->values[i]);
      return message_add(c->message, ": expected at least coulomb = %g", c->values[i + 1]);
    }
  }
  return 0;
}

static int check_angles(const check* c, const model_item* item) {
  for (uint32_t i = item->first + 1; i < item->first + item->count; ++i) {
    if (!(c->values[i] > c->values[i - 1])) {
      say_value(c->message, item, i, c->values[i]);
      return message_add(c->message, ": expected above the angle before it, %g rad", c->values[i - 1]);
    }
  }
  return 0;
}

static int check_axis(const check* c, const model_item* item) {
  const double* axis = c->values + item->first;
  if (axis[0] != 0.0 || axis[1] != 0.0 || axis[2] != 0.0) {
    return 0;
  }
  say_value(c->message, item, item->first, axis[0]);
  return message_add(c->message, ": expected an axis whose three numbers are not all 0");
}

/* the thresholds come before the extensions */
static void note_threshold(check* c, const model_item* item) {
  if (c->values[item->first] == 0.0 && !c->threshold.count) {
    c->threshold = *item;
  }
}

/* of the first numbers of some effects exactly one is above 0 */
static int check_one_of(const check* c, const model_item* item) {
  const double* values = c->values + item->first;
  const uint32_t count = (uint32_t)item->effect->one_of;
  uint32_t above = 0, last = 0;
  for (uint32_t k = 0; k < count; ++k) {
    above += values[k] > 0.0;
    last = values[k] > 0.0 ? k : last;
  }
  if (!count || above == 1) {
    return 0;
  }
  say_value(c->message, item, item->first + last, values[last]);
  return message_add(c->message, above ? ": expected 0 beside %s" : ": expected above 0, here or in %s",
                     item->effect->parameters[above ? 0 : 1].name);
}

/* a row without a place that counts distances by thresholds */
static int check_extension(const check* c, const model_item* item) {
  if (check_one_of(c, item)) {
    return -1;
  }
  if (!item->effect->parameters[0].unit_everywhere || !is_everywhere(item->place) || !c->threshold.count ||
      c->values[item->first] == 0.0) {
    return 0;
  }
  say_value(c->message, &c->threshold, c->threshold.first, 0.0);
  return message_add(
      c->message, ": expected above 0 %s, since extensions[%zu], %s without joint or tendon, multiplies it",
      parameter_range_of(&c->threshold, c->threshold.first).unit, (size_t)item->extension + 1, item->effect->name);
}

static int check_relation(void* context, const model_item* item) {
  check* c = context;
  if (item->law != LAW_ABSENT) {
    return check_law(c, item);
  }
  switch (item->kind) {
    case ITEM_EDGE_ANGLES: return check_angles(c, item);
    case ITEM_LINK_AXIS: return check_axis(c, item);
    case ITEM_TENDON_THRESHOLD:
    case ITEM_JOINT_THRESHOLD: note_threshold(c, item); return 0;
    case ITEM_EXTENSION: return check_extension(c, item);
    default: return 0;
  }
}

typedef struct routing {
  const double* values;
  double rows[MODEL_MAX_TENDONS * MODEL_MAX_JOINTS];
} routing;

static int collect_arms(void* context, const model_item* item) {
  routing* r = context;
  if (item->kind == ITEM_MOMENT_ARMS) {
    memcpy(r->rows + (size_t)item->tendon * item->count, r->values + item->first, item->count * sizeof(double));
  }
  return 0;
}

int parameter_check_relations(const model_shape* shape, const double* values, message_line message) {
  check c = {.values = values, .message = message};
  return model_visit(shape, check_relation, &c);
}

int parameter_check_routing(const model_shape* shape, const double* values, message_line message) {
  routing r = {.values = values};
  model_visit(shape, collect_arms, &r);
  if (pseudo_inverse(shape->tendons, shape->joints, r.rows, r.rows) < shape->joints) {
    return message_write(message,
                         "tendons: moment_arms are not of full column rank, so the joint angles do not follow from "
                         "the tendon positions; expected %zu linearly independent columns",
                         (size_t)shape->joints);
  }
  return 0;
}

int parameter_check_all(const model_shape* shape, const double* values, message_line message) {
  check c = {.values = values, .message = message};
  if (model_visit(shape, check_range, &c)) {
    return -1;
  }
  return parameter_check_relations(shape, values, message) || parameter_check_routing(shape, values, message) ? -1 : 0;
}
