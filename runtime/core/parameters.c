#include "floating_point.h"

#include "parameters.h"

#include <string.h>

#include "pseudo_inverse.h"

/* --- paths -------------------------------------------------------------------------------------------------------- */

static const char* const law_fields[4] = {"static", "coulomb", "stribeck_velocity", "viscous"};

static void path_index(message_line path, const char* name, uint32_t index) {
  message_text(path, name);
  message_text(path, "[");
  message_count(path, index + 1);
  message_text(path, "]");
}

static void path_of_law(message_line path, const model_item* item, uint32_t offset) {
  if (item->law == LAW_ASYMMETRIC) {
    message_text(path, offset < 4 ? ".positive" : ".negative");
  }
  message_text(path, ".");
  message_text(path, law_fields[offset % 4]);
}

static void path_of_joint(message_line path, const model_item* item, uint32_t offset) {
  path_index(path, "joints", item->joint);
  if (item->kind == ITEM_COVER) {
    message_text(path, offset == 0 ? ".cover.stiffness" : ".cover.rest_angle");
    return;
  }
  message_text(path, item->kind == ITEM_JOINT_FRICTION ? ".friction" : ".load_friction");
  path_of_law(path, item, offset);
}

static void path_of_tendon(message_line path, const model_item* item, uint32_t offset) {
  path_index(path, "tendons", item->tendon);
  if (item->kind == ITEM_STIFFNESS) {
    message_text(path, ".stiffness");
  } else if (item->kind == ITEM_MOMENT_ARMS) {
    path_index(path, ".moment_arms", offset);
  } else if (item->kind == ITEM_PULLEY_FRICTION) {
    path_index(path, ".pulley_friction", item->joint);
    path_of_law(path, item, offset);
  } else {
    path_index(path, ".edge_friction", item->joint);
    if (item->kind == ITEM_EDGE_ANGLES) {
      path_index(path, ".angles", offset);
      return;
    }
    if (item->has_angles) {
      path_index(path, ".laws", item->point);
    }
    path_of_law(path, item, offset);
  }
}

static void path_of_finger(message_line path, const model_item* item, uint32_t offset) {
  static const char* const names[] = {
      [ITEM_TENDON_THRESHOLD] = "velocity_threshold.tendon",
      [ITEM_JOINT_THRESHOLD] = "velocity_threshold.joint",
      [ITEM_FILTER_CUTOFF] = "velocity_filter_cutoff",
      [ITEM_DRIFT_VARIANCE] = "bias.drift_variance",
      [ITEM_NOISE_STD] = "bias.noise_std",
      [ITEM_NOISE_STD_PER_FORCE] = "bias.noise_std_per_force",
      [ITEM_INITIAL_VARIANCE] = "bias.initial_variance",
      [ITEM_FORGET_RATE] = "bias.forget_rate",
      [ITEM_INITIAL_TORQUE] = "bias.initial_torque",
      [ITEM_NOISE_TIME] = "bias.noise_time",
      [ITEM_START_SHARE] = "bias.start_share",
      [ITEM_CONTACT_THRESHOLD] = "contact.threshold",
      [ITEM_CONTACT_PER_FORCE] = "contact.threshold_per_force",
      [ITEM_HYSTERESIS] = "velocity_threshold.hysteresis",
      [ITEM_POSITION_NOISE] = "position_filter.noise",
      [ITEM_JERK_DENSITY] = "position_filter.jerk_density",
      [ITEM_INNOVATION_TIME] = "contact.innovation.time",
      [ITEM_INNOVATION_THRESHOLD] = "contact.innovation.threshold",
      [ITEM_INNOVATION_PER_FORCE] = "contact.innovation.threshold_per_force",
      [ITEM_EVIDENCE_TIME] = "contact.innovation.evidence_time",
      [ITEM_STUCK_SHARE] = "contact.friction_bound.stuck_share",
      [ITEM_JUMP_SHARE] = "contact.friction_bound.jump_share",
      [ITEM_JUMP_TIME] = "contact.friction_bound.jump_time",
      [ITEM_STUCK_TIME] = "contact.friction_bound.stuck_time",
      [ITEM_UNCERTAINTY_LEVEL] = "contact.uncertainty_level",
      [ITEM_DEVIATION] = "contact.deviation",
      [ITEM_DEVIATION_PER_FORCE] = "contact.deviation_per_force",
      [ITEM_RELEASE_RATIO] = "contact.release_ratio",
      [ITEM_HOLD_TIME] = "contact.hold_time",
      [ITEM_RELEASE_TIME] = "contact.release_time",
      [ITEM_DRIFT_QUICK_TIME] = "contact.drift.quick_time",
      [ITEM_DRIFT_SLOW_TIME] = "contact.drift.slow_time",
      [ITEM_DRIFT_THRESHOLD] = "contact.drift.threshold",
      [ITEM_DRIFT_PER_FORCE] = "contact.drift.threshold_per_force",
      [ITEM_REST_TRAVEL] = "contact.rest.travel",
      [ITEM_REST_SETTLE_TIME] = "contact.rest.settle_time",
      [ITEM_REST_AVERAGING_TIME] = "contact.rest.averaging_time",
      [ITEM_REST_THRESHOLD] = "contact.rest.threshold",
      [ITEM_REST_PER_FORCE] = "contact.rest.threshold_per_force",
      [ITEM_REST_CREEP] = "contact.rest.creep",
      [ITEM_REST_FALL_SHARE] = "contact.rest.fall_share",
      [ITEM_REST_INNOVATION_TIME] = "contact.rest.innovation.time",
      [ITEM_REST_INNOVATION_THRESHOLD] = "contact.rest.innovation.threshold",
      [ITEM_FAULT_HOLD_TIME] = "sensor_fault.hold_time",
      [ITEM_FAULT_FORCE_RESOLUTION] = "sensor_fault.force_resolution",
      [ITEM_FAULT_POSITION_RESOLUTION] = "sensor_fault.position_resolution",
      [ITEM_FAULT_JUMP_MARGIN] = "sensor_fault.jump_margin",
      [ITEM_FAULT_RECOVERY_TIME] = "sensor_fault.recovery_time",
  };
  switch (item->kind) {
    case ITEM_INITIAL_TORQUE:
    case ITEM_POSITION_NOISE:
    case ITEM_CONTACT_THRESHOLD:
    case ITEM_CONTACT_PER_FORCE:
    case ITEM_INNOVATION_THRESHOLD:
    case ITEM_INNOVATION_PER_FORCE:
    case ITEM_DEVIATION:
    case ITEM_DEVIATION_PER_FORCE:
    case ITEM_DRIFT_THRESHOLD:
    case ITEM_DRIFT_PER_FORCE:
    case ITEM_REST_THRESHOLD:
    case ITEM_REST_PER_FORCE:
    case ITEM_REST_CREEP:
    case ITEM_REST_INNOVATION_THRESHOLD: path_index(path, names[item->kind], offset); break;
    default: message_text(path, names[item->kind]); break;
  }
}

/* contact.uncertainty[joint,direction,share]: FMI's structured names have one bracket an array */
static void path_of_direction(message_line path, const model_item* item, uint32_t offset) {
  message_text(path, "contact.uncertainty[");
  message_count(path, item->joint + 1);
  message_text(path, ",");
  message_count(path, item->point + 1);
  message_text(path, ",");
  message_count(path, offset + 1);
  message_text(path, "]");
}

static void path_of_link(message_line path, const model_item* item, uint32_t offset) {
  if (item->kind != ITEM_TIP) {
    path_index(path, "links", item->joint);
  }
  path_index(path, item->kind == ITEM_TIP ? "tip" : item->kind == ITEM_LINK_AXIS ? ".axis" : ".offset", offset);
}

void parameter_path(const model_item* item, uint32_t index, char* path) {
  const message_line line = {path, PARAMETER_PATH_BYTES};
  const uint32_t offset = index - item->first;
  message_start(line, "");
  if (item->kind <= ITEM_LOAD_FRICTION) {
    path_of_joint(line, item, offset);
  } else if (item->kind <= ITEM_EDGE_FRICTION) {
    path_of_tendon(line, item, offset);
  } else if (item->kind == ITEM_UNCERTAINTY) {
    path_of_direction(line, item, offset);
  } else if (item->kind >= ITEM_LINK_AXIS && item->kind <= ITEM_TIP) {
    path_of_link(line, item, offset);
  } else if (item->kind < ITEM_EXTENSION) {
    path_of_finger(line, item, offset);
  } else {
    path_index(line, "extensions", item->extension);
    message_text(line, ".");
    message_text(line, item->effect->parameters[offset].name);
  }
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

/* Far beyond anything built, yet small enough that no product of a few of them overflows. */
#define LARGE 1e9

static parameter_range range_of_law(const model_item* item, uint32_t offset) {
  /* magnitudes multiply a tendon force (1), are torques (N.m), or multiply a sum of forces (m) */
  static const char* const units[3][2] = {{"1", "s/m"}, {"N.m", "N.m.s/rad"}, {"m", "m.s/rad"}};
  const int kind = item->kind == ITEM_JOINT_FRICTION ? 1 : item->kind == ITEM_LOAD_FRICTION ? 2 : 0;
  if (offset % 4 == 2) {
    return (parameter_range){kind ? "rad/s" : "m/s", 0.0, LARGE, 1, 1};
  }
  return (parameter_range){units[kind][offset % 4 == 3], 0.0, LARGE, 0, 1};
}

static parameter_range range_of_effect(const model_item* item, uint32_t offset) {
  const effect_parameter* p = &item->effect->parameters[offset];
  const int at_joint = item->place.joint != EFFECT_NOWHERE;
  const char* elsewhere = at_joint ? p->unit_at_joint : is_everywhere(item->place) ? p->unit_everywhere : NULL;
  return (parameter_range){elsewhere ? elsewhere : p->unit, p->minimum, p->maximum, p->above_minimum, 1};
}

parameter_range parameter_range_of(const model_item* item, uint32_t index) {
  static const parameter_range ranges[] = {
      [ITEM_STIFFNESS] = {"N/m", 0.0, 1e12, 1, 0},
      [ITEM_MOMENT_ARMS] = {"m", -1e3, 1e3, 0, 0},
      [ITEM_EDGE_ANGLES] = {"rad", -1e6, 1e6, 0, 0},
      [ITEM_TENDON_THRESHOLD] = {"m/s", 0.0, LARGE, 0, 1},
      [ITEM_JOINT_THRESHOLD] = {"rad/s", 0.0, LARGE, 0, 1},
      [ITEM_FILTER_CUTOFF] = {"Hz", 0.0, LARGE, 0, 1},
      [ITEM_DRIFT_VARIANCE] = {"N2.m2/s", 0.0, LARGE, 0, 1},
      [ITEM_NOISE_STD] = {"N.m", 0.0, LARGE, 0, 1},
      [ITEM_NOISE_STD_PER_FORCE] = {"m", 0.0, LARGE, 0, 1},
      [ITEM_INITIAL_VARIANCE] = {"N2.m2", 0.0, LARGE, 0, 0},
      [ITEM_FORGET_RATE] = {"1/s", 0.0, LARGE, 0, 1},
      [ITEM_INITIAL_TORQUE] = {"N.m", -LARGE, LARGE, 0, 0},
      [ITEM_NOISE_TIME] = {"s", 0.0, LARGE, 0, 1},
      [ITEM_START_SHARE] = {"1", 0.0, 1.0, 0, 1},
      [ITEM_CONTACT_THRESHOLD] = {"N.m", 0.0, LARGE, 0, 1},
      [ITEM_CONTACT_PER_FORCE] = {"m", 0.0, LARGE, 0, 1},
      [ITEM_HYSTERESIS] = {"1", 0.0, 1.0, 0, 1},
      [ITEM_POSITION_NOISE] = {"rad", 1e-6, 1e3, 0, 1}, /* below, the filter's variances would drown in rounding */
      [ITEM_JERK_DENSITY] = {"rad2/s5", 0.0, LARGE, 1, 1},
      [ITEM_INNOVATION_TIME] = {"s", 0.0, LARGE, 1, 1},
      [ITEM_INNOVATION_THRESHOLD] = {"N.m", 0.0, LARGE, 0, 1},
      [ITEM_INNOVATION_PER_FORCE] = {"m", 0.0, LARGE, 0, 1},
      [ITEM_EVIDENCE_TIME] = {"s", 0.0, LARGE, 1, 1},
      [ITEM_STUCK_SHARE] = {"1", 0.0, 10.0, 0, 1},
      [ITEM_JUMP_SHARE] = {"1", 0.0, 10.0, 0, 1},
      [ITEM_JUMP_TIME] = {"s", 0.0, LARGE, 1, 1},
      [ITEM_STUCK_TIME] = {"s", 0.0, LARGE, 0, 1},
      [ITEM_UNCERTAINTY] = {"1", -LARGE, LARGE, 0, 1},
      [ITEM_UNCERTAINTY_LEVEL] = {"1", 0.0, 100.0, 0, 1},
      [ITEM_DEVIATION] = {"N.m", 0.0, LARGE, 0, 1},
      [ITEM_DEVIATION_PER_FORCE] = {"m", 0.0, LARGE, 0, 1},
      [ITEM_RELEASE_RATIO] = {"1", 0.0, 1.0, 1, 1},
      [ITEM_HOLD_TIME] = {"s", 0.0, LARGE, 0, 1},
      [ITEM_RELEASE_TIME] = {"s", 0.0, LARGE, 0, 1},
      [ITEM_DRIFT_QUICK_TIME] = {"s", 0.0, LARGE, 1, 1},
      [ITEM_DRIFT_SLOW_TIME] = {"s", 0.0, LARGE, 1, 1},
      [ITEM_DRIFT_THRESHOLD] = {"N.m", 0.0, LARGE, 0, 1},
      [ITEM_DRIFT_PER_FORCE] = {"m", 0.0, LARGE, 0, 1},
      [ITEM_REST_TRAVEL] = {"m", 0.0, LARGE, 0, 1},
      [ITEM_REST_SETTLE_TIME] = {"s", 0.0, LARGE, 0, 1},
      [ITEM_REST_AVERAGING_TIME] = {"s", 0.0, LARGE, 0, 1},
      [ITEM_REST_THRESHOLD] = {"N.m", 0.0, LARGE, 1, 1}, /* a load of no size has no direction */
      [ITEM_REST_PER_FORCE] = {"m", 0.0, LARGE, 0, 1},
      [ITEM_REST_CREEP] = {"N.m", 0.0, LARGE, 0, 1},
      [ITEM_REST_FALL_SHARE] = {"1", 0.0, 1.0, 0, 1},
      [ITEM_REST_INNOVATION_TIME] = {"s", 0.0, LARGE, 1, 1},
      [ITEM_REST_INNOVATION_THRESHOLD] = {"N.m", 0.0, LARGE, 1, 1},
      [ITEM_LINK_AXIS] = {"1", -1e6, 1e6, 0, 0},
      [ITEM_LINK_OFFSET] = {"m", -10.0, 10.0, 0, 0},
      [ITEM_TIP] = {"m", -10.0, 10.0, 0, 0},
      [ITEM_FAULT_HOLD_TIME] = {"s", 0.0, LARGE, 0, 1},
      [ITEM_FAULT_FORCE_RESOLUTION] = {"N", 0.0, LARGE, 0, 1},
      [ITEM_FAULT_POSITION_RESOLUTION] = {"m", 0.0, LARGE, 0, 1},
      [ITEM_FAULT_JUMP_MARGIN] = {"N", 0.0, LARGE, 1, 1}, /* without one rounding would be a fault */
      [ITEM_FAULT_RECOVERY_TIME] = {"s", 0.0, LARGE, 0, 1},
  };
  const uint32_t offset = index - item->first;
  switch (item->kind) {
    case ITEM_COVER:
      return offset == 0 ? (parameter_range){"N.m/rad", 0.0, LARGE, 0, 1} : (parameter_range){"rad", -1e6, 1e6, 0, 1};
    case ITEM_JOINT_FRICTION:
    case ITEM_LOAD_FRICTION:
    case ITEM_PULLEY_FRICTION:
    case ITEM_EDGE_FRICTION: return range_of_law(item, offset);
    case ITEM_EXTENSION: return range_of_effect(item, offset);
    default: return ranges[item->kind];
  }
}

/* --- checks ------------------------------------------------------------------------------------------------------- */

/* "<path> = <value>" */
static void say_value(message_line message, const model_item* item, uint32_t index, double value) {
  char path[PARAMETER_PATH_BYTES];
  parameter_path(item, index, path);
  message_start(message, path);
  message_text(message, " = ");
  message_number(message, value);
}

void parameter_say_range(const model_item* item, uint32_t index, message_line message) {
  const parameter_range range = parameter_range_of(item, index);
  message_text(message, range.above_minimum ? "above " : "");
  message_number(message, range.minimum);
  message_text(message, range.above_minimum ? " and at most " : " to ");
  message_number(message, range.maximum);
  message_text(message, " ");
  message_text(message, range.unit);
}

int parameter_check_value(const model_item* item, uint32_t index, double value, message_line message) {
  const parameter_range range = parameter_range_of(item, index);
  if (value <= range.maximum && (range.above_minimum ? value > range.minimum : value >= range.minimum)) {
    return 0;
  }
  say_value(message, item, index, value);
  message_text(message, ": expected ");
  parameter_say_range(item, index, message);
  return -1;
}

typedef struct check {
  const double* values;
  message_line message;
  const model_shape* shape;
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
      message_text(c->message, ": expected at least coulomb = ");
      message_number(c->message, c->values[i + 1]);
      return -1;
    }
  }
  return 0;
}

static int check_angles(const check* c, const model_item* item) {
  for (uint32_t i = item->first + 1; i < item->first + item->count; ++i) {
    if (!(c->values[i] > c->values[i - 1])) {
      say_value(c->message, item, i, c->values[i]);
      message_text(c->message, ": expected above the angle before it, ");
      message_number(c->message, c->values[i - 1]);
      message_text(c->message, " rad");
      return -1;
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
  message_text(c->message, ": expected an axis whose three numbers are not all 0");
  return -1;
}

/* the thresholds come before the extensions */
static void note_threshold(check* c, const model_item* item) {
  if (c->values[item->first] == 0.0 && !c->threshold.count) {
    c->threshold = *item;
  }
}

/* a row without a place that counts distances by thresholds */
static int check_extension(const check* c, const model_item* item) {
  if (!item->effect->yields || !is_everywhere(item->place) || !c->threshold.count) {
    return 0;
  }
  say_value(c->message, &c->threshold, c->threshold.first, 0.0);
  message_text(c->message, ": expected above 0 ");
  message_text(c->message, parameter_range_of(&c->threshold, c->threshold.first).unit);
  message_text(c->message, ", since extensions[");
  message_count(c->message, item->extension + 1);
  message_text(c->message, "], ");
  message_text(c->message, item->effect->name);
  message_text(c->message, " without joint or tendon, multiplies it");
  return -1;
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
  check c = {.values = values, .message = message, .shape = shape};
  return model_visit(shape, check_relation, &c);
}

int parameter_check_routing(const model_shape* shape, const double* values, message_line message) {
  routing r = {.values = values};
  double inverse[MODEL_MAX_TENDONS * MODEL_MAX_JOINTS];
  model_visit(shape, collect_arms, &r);
  if (pseudo_inverse(shape->tendons, shape->joints, r.rows, inverse) < shape->joints) {
    message_start(message,
                  "tendons: moment_arms are not of full column rank, so the joint angles do not follow from "
                  "the tendon positions; expected ");
    message_count(message, shape->joints);
    message_text(message, " linearly independent columns");
    return -1;
  }
  return 0;
}

int parameter_check_all(const model_shape* shape, const double* values, message_line message) {
  check c = {.values = values, .message = message, .shape = shape};
  if (model_visit(shape, check_range, &c)) {
    return -1;
  }
  return parameter_check_relations(shape, values, message) || parameter_check_routing(shape, values, message) ? -1 : 0;
}
