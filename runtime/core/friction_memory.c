#include "floating_point.h"

#include "extensions.h"

#include <math.h>
#include <string.h>

#include "effect_facts.h"
#include "friction_law.h"
#include "kernel_choice.h"

/* Friction with a memory: numbers alone. */
const effect_action presliding_action = {.kind = EFFECT_MEMORY};
const effect_action cord_stretch_action = {.kind = EFFECT_MEMORY};

#define LEAST_DISTANCE 1e-150 /* m, rad: however short, no product in a step overflows */
#define STEEPEST       1e290  /* 1/m, 1/rad, of z */

/* numbers of a row of presliding, as in effects.json */
enum { DISPLACEMENT, STIFFNESS, RELAXATION_TIME, SHARE, FOLLOWS_LIMIT, FILTERED_TRAVEL };

static const double none[EFFECT_MAX_PARAMETERS]; /* of an element that is not there: its share is 0 */

/* how specific a row of presliding is at a slot; 0: it does not act there */
static int rank_at(const tendonfmu_finger* f, effect_place place, size_t slot) {
  const size_t lanes = f->tendon_lanes, joint_row = f->joints * lanes;
  if (slot >= joint_row) {
    const size_t joint = slot - joint_row;
    const int here = place.joint == joint && place.tendon == EFFECT_NOWHERE;
    return joint >= f->joints ? 0 : is_everywhere(place) ? 1 : here ? 2 : 0;
  }
  const size_t level = slot / lanes, tendon = slot % lanes;
  if (tendon >= f->tendons) {
    return 0;
  }
  if (place.tendon != EFFECT_NOWHERE) {
    const int here = place.tendon == tendon;
    return !here ? 0 : place.joint == EFFECT_NOWHERE ? 3 : place.joint == level ? 4 : 0;
  }
  return is_everywhere(place) ? 1 : place.level == level ? 2 : 0;
}

/* mean square of the moment arms at a joint, m² */
static double mean_square_arm(const tendonfmu_finger* f, size_t joint) {
  double sum = 0.0;
  for (size_t i = 0; i < f->tendons; ++i) {
    const double arm = f->derived.moment_arm[joint * f->tendon_lanes + i];
    sum += arm * arm;
  }
  return sum / (double)f->tendons;
}

static void set_element(tendonfmu_finger* f, size_t e, size_t slot, effect_place place, const double* numbers) {
  const friction_element* to = &f->memory.element[e];
  const size_t joint_row = f->joints * f->tendon_lanes;
  const int own = slot >= joint_row, everywhere = is_everywhere(place);
  const double distance = numbers[DISPLACEMENT] * (everywhere ? threshold_of(f, slot) : 1.0);
  const double scale = own && everywhere ? mean_square_arm(f, slot - joint_row) : 1.0;
  const int absolute = numbers[STIFFNESS] > 0.0;
  to->share[slot] = numbers[SHARE];
  to->stiffness[slot] = absolute ? numbers[STIFFNESS] * scale : 0.0;
  to->per_distance[slot] = absolute ? 0.0 : 1.0 / (distance > LEAST_DISTANCE ? distance : LEAST_DISTANCE);
  to->relaxation_time[slot] = numbers[RELAXATION_TIME];
  to->follows[slot] = numbers[FOLLOWS_LIMIT];
  f->memory.relaxes |= numbers[RELAXATION_TIME] > 0.0;
  f->memory.follows |= numbers[FOLLOWS_LIMIT] > 0.0;
  f->memory.filtered = fmax(f->memory.filtered, numbers[FILTERED_TRAVEL]);
}

/* the rows that hold at a slot, at most two; none where the tendon moves no joint from there on */
static void find_elements(tendonfmu_finger* f, size_t slot) {
  const int turns = slot >= f->joints * f->tendon_lanes || f->memory.sections[slot] > 0.0;
  size_t found = 0;
  int rank = 0;
  double sum = 0.0;
  for (size_t r = 0; r < f->extensions.memories; ++r) {
    const extension_row* row = f->extensions.memory + r;
    const int here = turns && row->action == &presliding_action ? rank_at(f, row->place, slot) : 0;
    if (here > rank) {
      rank = here;
      found = 0;
      sum = 0.0;
    }
    if (here && here == rank && found < elements_of(f)) {
      set_element(f, found++, slot, row->place, row->parameters);
      sum += row->parameters[SHARE];
    }
  }
  f->memory.remembers[slot] = found ? 1.0 : 0.0;
  for (size_t e = 0; e < found; ++e) {
    f->memory.element[e].share[slot] /= sum;
  }
  for (size_t e = found; e < elements_of(f); ++e) {
    set_element(f, e, slot, (effect_place){EFFECT_NOWHERE, EFFECT_NOWHERE, EFFECT_NOWHERE}, none);
  }
}

/* 1/k_c, m/N; 0: rigid */
static double cord_compliance(const tendonfmu_finger* f) {
  for (size_t r = 0; r < f->extensions.memories; ++r) {
    const extension_row* row = f->extensions.memory + r;
    if (row->action == &cord_stretch_action) {
      return 1.0 / row->parameters[0];
    }
  }
  return 0.0;
}

/* S at every level: the sections of cord from there to the last joint that the tendon moves */
static void find_sections(tendonfmu_finger* f) {
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    double beyond = 0.0;
    for (size_t j = f->joints; j-- > 0;) {
      const size_t slot = j * f->tendon_lanes + i;
      beyond += beyond > 0.0 || f->derived.moment_arm[slot] != 0.0 ? 1.0 : 0.0;
      f->memory.sections[slot] = beyond;
    }
  }
}

/* g, of a relaxation time; 1 without one, and at the first sample, whose step is 0 */
static double decayed_gain(double time, double step) {
  const double age = time > 0.0 ? step / time : 0.0;
  return age > 0.0 ? law_one_minus_exponential(age) / age : 1.0;
}

/* what a and g make of every place in a step of this length, s; most places share their relaxation time */
static void find_decay(tendonfmu_finger* f, double step) {
  double time = -1.0, kept = 1.0, gain = 1.0;
  for (size_t e = 0; e < elements_of(f); ++e) {
    const friction_element* element = &f->memory.element[e];
    for (size_t slot = 0; slot < f->slots; ++slot) {
      if (element->relaxation_time[slot] != time) {
        time = element->relaxation_time[slot];
        kept = time > 0.0 ? law_exponential(step / time) : 1.0;
        gain = decayed_gain(time, step);
      }
      element->kept[slot] = kept;
      element->stiff[slot] = gain * element->stiffness[slot];
      element->soft[slot] = gain * element->per_distance[slot];
    }
  }
  f->memory.step = step;
}

void find_memory(tendonfmu_finger* f) {
  f->memory.relaxes = f->memory.follows = 0;
  f->memory.filtered = 0.0;
  if (!elements_of(f)) {
    return;
  }
  f->memory.compliance = cord_compliance(f);
  find_sections(f);
  for (size_t slot = 0; slot < f->slots; ++slot) {
    find_elements(f, slot);
  }
  find_decay(f, 0.0);
}

void turn_places(tendonfmu_finger* f, double step) {
  const finger_scratch* s = &f->scratch;
  const int first = is_first(f);
  const double filtered = filtered_travel(f);
  const size_t joint_row = f->joints * f->tendon_lanes;
  for (size_t j = 0; j < f->joint_lanes; ++j) {
    const double raw = s->angle[j] - angle_before_step(f, j);
    const double travel = filtered * s->velocity[joint_row + j] * step + (1.0 - filtered) * raw;
    s->travelled[joint_row + j] = first ? 0.0 : travel;
    s->own_limit[j] = 0.0;
  }
  f->kernel->tendon_velocities(f, s->travelled);
  f->memory.stretch = first ? 0.0 : f->memory.compliance;
  if (f->memory.relaxes && f->memory.step != (first ? 0.0 : step)) {
    find_decay(f, first ? 0.0 : step);
  }
}

/* --- friction as a torque -------------------------------------------------------------------------------------------
 */

/* ∂z/∂travel of what does not slip, without relaxation */
static double steepness(const tendonfmu_finger* f, size_t slot, double size) {
  const friction_element* first = &f->memory.element[0];
  if (first->stiffness[slot] == 0.0) {
    return first->per_distance[slot];
  }
  const double slope = size > 0.0 ? first->stiffness[slot] / size : STEEPEST;
  return slope < STEEPEST ? slope : STEEPEST;
}

void follow_elements(const tendonfmu_finger* f, const extension_row* row, double size) {
  const size_t joint_row = f->joints * f->tendon_lanes;
  const friction_element* first = &f->memory.element[0];
  for (size_t k = 0; k < row->memory_count; ++k) {
    const size_t slot = row->action->slot(row, f->joints, f->tendon_lanes, k);
    if (f->memory.remembers[slot] == 0.0) {
      continue;
    }
    if (slot >= joint_row) {
      f->scratch.own_limit[slot - joint_row] += size;
      row->now[k] = 0.0;
      continue;
    }
    const double travel = f->scratch.travelled[slot], z = first->kept[slot] * row->before[k];
    const double gain =
        decayed_gain(first->relaxation_time[slot], f->scratch.sample.first ? 0.0 : f->scratch.sample.step);
    const double moved = travel == 0.0 ? z : z + gain * steepness(f, slot, size) * travel;
    row->now[k] = moved > 1.0 ? 1.0 : moved < -1.0 ? -1.0 : moved;
  }
}

double follower_slope(const tendonfmu_finger* f, const extension_row* row, size_t k, double size) {
  const size_t slot = row->action->slot(row, f->joints, f->tendon_lanes, k);
  const double z = row->now[k];
  if (slot >= f->joints * f->tendon_lanes || f->memory.remembers[slot] == 0.0 || z >= 1.0 || z <= -1.0) {
    return 0.0;
  }
  return decayed_gain(f->memory.element[0].relaxation_time[slot], f->remembered.scalar[STATE_STEP]) *
         steepness(f, slot, size);
}
