#include "plant_settings.h"

#include <math.h>
#include <string.h>

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
