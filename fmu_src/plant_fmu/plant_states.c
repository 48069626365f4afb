/* Settings and saved states of the simulated finger. */
#include <math.h>
#include <string.h>

#include "plant_model.h"

#define PLACE(NAME, field, type) {GROUP_##NAME, SETTING_##NAME},
static const struct {
  variable_group_id group;
  size_t place;
} places[] = {SETTINGS(PLACE){GROUP_PUSH_POINT, SETTING_PUSH_POINT}};
enum { PLACES = sizeof places / sizeof *places };

size_t setting_place(variable_group_id group, size_t index) {
  size_t k = 0;
  while (k < PLACES - 1 && places[k].group != group) {
    ++k;
  }
  return places[k].place + index;
}

#define TO_NUMBER(NAME, field, type)   numbers[SETTING_##NAME] = (double)settings->field;
#define FROM_NUMBER(NAME, field, type) settings.field = (type)numbers[SETTING_##NAME];

void settings_to_numbers(const tendonfmu_plant_settings* settings, double numbers[SETTING_COUNT]) {
  SETTINGS(TO_NUMBER)
  memcpy(numbers + SETTING_PUSH_POINT, settings->push_point, sizeof settings->push_point);
}

tendonfmu_plant_settings settings_from_numbers(const double numbers[SETTING_COUNT]) {
  tendonfmu_plant_settings settings;
  SETTINGS(FROM_NUMBER)
  memcpy(settings.push_point, numbers + SETTING_PUSH_POINT, sizeof settings.push_point);
  return settings;
}

model_range setting_range(variable_group_id group, size_t joints) {
  const variable_group* entry = &variable_groups[group];
  model_range range = {.unit = entry->unit, .minimum = entry->minimum, .maximum = entry->maximum};
  if (entry->type == VARIABLE_BOOLEAN) {
    range.maximum = 1.0;
  } else if (group == GROUP_PUSH_LINK) {
    range.maximum = (double)joints;
  }
  return range;
}

int settings_are_sound(const double numbers[SETTING_COUNT], size_t joints) {
  for (size_t k = 0; k < PLACES; ++k) {
    const variable_group* entry = &variable_groups[places[k].group];
    const model_range range = setting_range(places[k].group, joints);
    for (size_t i = 0; i < (entry->size == SIZE_VECTOR ? 3u : 1u); ++i) {
      const double value = numbers[places[k].place + i];
      const int is_whole = entry->type == VARIABLE_REAL || value == floor(value);
      if (!(value >= range.minimum && value <= range.maximum) || !is_whole) {
        return 0;
      }
    }
  }
  return 1;
}

/* --- saved states ------------------------------------------------------------------------------------------------- */

/* Numbers as doubles in the order below, then the plant's own bytes. Before the initialisation the plant's bytes are
 * zeros: what it settles to follows from settings and inputs. */

/* inputs [input_count] follow */
enum { AT_RUNNING, AT_START, AT_COMMANDED, AT_TOLERANCE_WRITTEN, AT_SETTINGS, AT_INPUTS = AT_SETTINGS + SETTING_COUNT };

static size_t plant_offset(const model* m) {
  return (AT_INPUTS + m->input_count) * sizeof(double);
}

static void put(void* bytes, size_t at, const double* values, size_t count) {
  memcpy((char*)bytes + at * sizeof(double), values, count * sizeof(double));
}

static void get(const void* bytes, size_t at, double* values, size_t count) {
  memcpy(values, (const char*)bytes + at * sizeof(double), count * sizeof(double));
}

static const void* plant_bytes(const model* m, const void* bytes) {
  return (const char*)bytes + plant_offset(m);
}

size_t plant_model_state_size(const model* m) {
  return plant_offset(m) + m->plant_state_size;
}

void model_save(const model* m, void* bytes) {
  const double life[] = {m->running, m->start, m->running && m->commanded, m->tolerance_written};
  memset(bytes, 0, plant_model_state_size(m));
  put(bytes, AT_RUNNING, life, AT_SETTINGS);
  put(bytes, AT_SETTINGS, m->wanted, SETTING_COUNT);
  if (m->running) {
    put(bytes, AT_INPUTS, m->inputs, m->input_count);
    tendonfmu_plant_save_state(m->plant, (char*)bytes + plant_offset(m), m->plant_state_size);
  }
}

static int is_flag(double x) {
  return x == 0.0 || x == 1.0;
}

/* What model_save() leaves out of a finger that has not settled is zeros. */
static int is_blank(const model* m, const void* bytes) {
  const unsigned char* byte = bytes;
  size_t at = AT_INPUTS * sizeof(double);
  while (at < plant_model_state_size(m) && byte[at] == 0) {
    ++at;
  }
  return at == plant_model_state_size(m);
}

const char* model_check_state(model* m, const void* bytes, int may_be_initialised) {
  double life[AT_SETTINGS], settings[SETTING_COUNT];
  get(bytes, AT_RUNNING, life, AT_SETTINGS);
  get(bytes, AT_SETTINGS, settings, SETTING_COUNT);
  const int running = life[AT_RUNNING] != 0.0;
  if (running && !may_be_initialised) {
    return "damaged state: its phase does not fit its finger";
  }
  if (!is_flag(life[AT_RUNNING]) || !isfinite(life[AT_START]) || !is_flag(life[AT_COMMANDED]) ||
      !is_flag(life[AT_TOLERANCE_WRITTEN]) || !settings_are_sound(settings, m->joints) ||
      (!running && (life[AT_COMMANDED] != 0.0 || !is_blank(m, bytes)))) {
    return "damaged state: a number is out of its range";
  }
  return NULL; /* the plant looks at its own bytes when it takes them */
}

static int restore_plant(model* m, const double* settings, const void* state) {
  if (memcmp(m->used, settings, sizeof m->used) != 0 && plant_start_over(m, settings)) {
    return -1;
  }
  const tendonfmu_plant_status status = tendonfmu_plant_restore_state(m->plant, state, m->plant_state_size);
  return status == TENDONFMU_PLANT_OK ? 0 : plant_failed(m);
}

/* Restores the plant from a state. If the plant refuses it, the plant goes back to how it was. */
static int take_plant(model* m, const double* settings, const void* state) {
  char reason[PLANT_ERROR_BYTES];
  double former[SETTING_COUNT];
  const int commanded = m->commanded;
  memcpy(former, m->used, sizeof former);
  if (m->running) {
    tendonfmu_plant_save_state(m->plant, m->scratch, m->plant_state_size);
  }
  if (restore_plant(m, settings, state) == 0) {
    return 0;
  }
  memcpy(reason, m->error, sizeof reason);
  if (!m->running || restore_plant(m, former, m->scratch)) {
    tendonfmu_plant_reset(m->plant);
  }
  m->commanded = commanded;
  memcpy(m->error, reason, sizeof reason);
  return -1;
}

int model_restore(model* m, const void* bytes) {
  double life[AT_SETTINGS], settings[SETTING_COUNT];
  get(bytes, AT_RUNNING, life, AT_SETTINGS);
  get(bytes, AT_SETTINGS, settings, SETTING_COUNT);
  const int running = life[AT_RUNNING] != 0.0;
  if (running && take_plant(m, settings, plant_bytes(m, bytes))) {
    return -1;
  }
  if (running) {
    get(bytes, AT_INPUTS, m->inputs, m->input_count);
  } else {
    tendonfmu_plant_reset(m->plant);
  }
  memcpy(m->wanted, settings, sizeof settings);
  m->running = running;
  m->start = life[AT_START];
  m->commanded = life[AT_COMMANDED] != 0.0;
  m->tolerance_written = life[AT_TOLERANCE_WRITTEN] != 0.0;
  return 0;
}
