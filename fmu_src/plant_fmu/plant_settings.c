#include "plant_settings.h"

#include <math.h>

static const struct {
  variable_group_id group;
  size_t place;
} places[] = {{GROUP_INTEGRATOR, SETTING_INTEGRATOR},
              {GROUP_RELATIVE_TOLERANCE, SETTING_RELATIVE_TOLERANCE},
              {GROUP_STEP, SETTING_STEP},
              {GROUP_SCHEDULED_MOTION, SETTING_SCHEDULED_MOTION},
              {GROUP_SCHEDULED_PUSHES, SETTING_SCHEDULED_PUSHES},
              {GROUP_SENSORS, SETTING_SENSORS},
              {GROUP_SEED, SETTING_SEED},
              {GROUP_PUSH_LINK, SETTING_PUSH_LINK},
              {GROUP_PUSH_POINT, SETTING_PUSH_POINT}};
enum { PLACES = sizeof places / sizeof *places };

size_t setting_place(variable_group_id group, size_t index) {
  size_t k = 0;
  while (k < PLACES - 1 && places[k].group != group) {
    ++k;
  }
  return places[k].place + index;
}

void settings_to_numbers(const tendonfmu_plant_settings* settings, double numbers[SETTING_COUNT]) {
  numbers[SETTING_INTEGRATOR] = settings->integrator;
  numbers[SETTING_RELATIVE_TOLERANCE] = settings->relative_tolerance;
  numbers[SETTING_STEP] = settings->step;
  numbers[SETTING_SCHEDULED_MOTION] = settings->scheduled_motion;
  numbers[SETTING_SCHEDULED_PUSHES] = settings->scheduled_pushes;
  numbers[SETTING_SENSORS] = settings->sensors;
  numbers[SETTING_SEED] = (double)settings->seed;
  numbers[SETTING_PUSH_LINK] = settings->push_link;
  for (size_t i = 0; i < 3; ++i) {
    numbers[SETTING_PUSH_POINT + i] = settings->push_point[i];
  }
}

tendonfmu_plant_settings settings_from_numbers(const double numbers[SETTING_COUNT]) {
  tendonfmu_plant_settings settings = {.integrator = (int)numbers[SETTING_INTEGRATOR],
                                       .relative_tolerance = numbers[SETTING_RELATIVE_TOLERANCE],
                                       .step = numbers[SETTING_STEP],
                                       .scheduled_motion = numbers[SETTING_SCHEDULED_MOTION] != 0.0,
                                       .scheduled_pushes = numbers[SETTING_SCHEDULED_PUSHES] != 0.0,
                                       .sensors = numbers[SETTING_SENSORS] != 0.0,
                                       .seed = (uint64_t)numbers[SETTING_SEED],
                                       .push_link = (int)numbers[SETTING_PUSH_LINK]};
  for (size_t i = 0; i < 3; ++i) {
    settings.push_point[i] = numbers[SETTING_PUSH_POINT + i];
  }
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
