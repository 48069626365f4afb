#include "floating_point.h"

#include "effect_facts.h"

#include "presliding_step.h"

/* per velocity of the place */
enum {
  SHARE = PRESLIDING_SHARE,
  BY_DISPLACEMENT = PRESLIDING_BY_DISPLACEMENT,
  BY_MOTION = PRESLIDING_BY_MOTION,
  KEPT = PRESLIDING_KEPT,
  MEMORY_ROWS = PRESLIDING_NUMBERS
};

static size_t member_count(effect_place place, size_t joints, size_t tendons) {
  return place.joint != EFFECT_NOWHERE ? 1 : is_everywhere(place) ? joints * (tendons + 1) : joints;
}

static size_t state_count(size_t joints, size_t tendons, effect_place place) {
  return MEMORY_ROWS * member_count(place, joints, tendons);
}

/* A velocity of the place. */
typedef struct member_of_place {
  int at_joint;
  size_t at; /* of a joint: which one; of a tendon: where it stands among the tendon velocities */
} member_of_place;

static member_of_place find_member(effect_place place, const effect_sample* sample, size_t k) {
  const size_t along_tendons = sample->joints * sample->tendons;
  if (place.joint != EFFECT_NOWHERE) {
    return (member_of_place){1, place.joint};
  }
  if (place.tendon != EFFECT_NOWHERE) {
    return (member_of_place){0, k * sample->lanes + place.tendon};
  }
  if (k < along_tendons) {
    return (member_of_place){0, k / sample->tendons * sample->lanes + k % sample->tendons};
  }
  return (member_of_place){1, k - along_tendons};
}

/* its travel within the sample */
static double travel_of(const effect_sample* sample, int at_joint, size_t at) {
  if (sample->travel) {
    return at_joint ? sample->travel[at] : sample->tendon_travel[at];
  }
  return (at_joint ? sample->velocity[at] : sample->tendon_velocity[at]) * sample->step;
}

static double distance_of(effect_place place, double displacement, const effect_sample* sample, int at_joint) {
  return presliding_distance(place, displacement, at_joint ? sample->joint_threshold : sample->tendon_threshold);
}

static void advance_member(double displacement, double distance, double travel, const effect_sample* sample,
                           const double* before, double* after) {
  const quad zero = quad_set(0.0), later = quad_set(sample->first ? 0.0 : 1.0);
  const presliding_places place = {.displacement = quad_set(displacement),
                                   .distance = quad_set(distance),
                                   .travel = quad_set(travel),
                                   .by_motion = quad_set(sample->travel ? 1.0 : sample->step),
                                   .has_slopes = quad_greater(later, zero)};
  quad numbers[MEMORY_ROWS];
  presliding_step(&place, quad_set(before[SHARE]), quad_set(before[BY_DISPLACEMENT]), numbers);
  for (int k = 0; k < MEMORY_ROWS; ++k) {
    after[k] = numbers[k].lane[0];
  }
}

/* the kernels do the same for all rows at once */
static void advance(effect_place place, const double* values, const effect_sample* sample, const double* before,
                    double* after) {
  const size_t count = member_count(place, sample->joints, sample->tendons);
  for (size_t k = 0; k < count; ++k, before += MEMORY_ROWS, after += MEMORY_ROWS) {
    const member_of_place member = find_member(place, sample, k);
    const double travel = sample->first ? 0.0 : travel_of(sample, member.at_joint, member.at);
    const double distance = distance_of(place, values[0], sample, member.at_joint);
    advance_member(values[0], distance, travel, sample, before, after);
  }
}

/* ẋ_ij = Σ_{j' >= j} r_ij'·q̇_j' of slopes; `at` is that of ij */
static double along_tendon(const effect_sample* sample, const double* motion, size_t at) {
  double sum = 0.0;
  for (size_t j = sample->joints; j-- > at / sample->lanes;) {
    sum += sample->moment_arm[j * sample->lanes + at % sample->lanes] * motion[j];
  }
  return sum;
}

static void advance_slope(effect_place place, const double* values, const effect_sample* sample, const double* before,
                          const effect_direction* direction, const double* slope_before, double* slope_after) {
  const size_t count = member_count(place, sample->joints, sample->tendons);
  for (size_t k = 0; k < count; ++k) {
    const size_t row = MEMORY_ROWS * k;
    const member_of_place member = find_member(place, sample, k);
    const double distance = distance_of(place, values[0], sample, member.at_joint);
    const double travel = sample->first ? 0.0 : travel_of(sample, member.at_joint, member.at);
    const double slope =
        member.at_joint ? direction->motion[member.at] : along_tendon(sample, direction->motion, member.at);
    double after[MEMORY_ROWS];
    advance_member(values[0], distance, travel, sample, before + row, after);
    slope_after[row + SHARE] = after[KEPT] * slope_before[row + SHARE] + after[BY_MOTION] * slope;
    for (size_t k = BY_DISPLACEMENT; k < MEMORY_ROWS; ++k) {
      slope_after[row + k] = 0.0; /* only the share is read */
    }
  }
}

static effect_grip grip(effect_place place, const double* values, const double* memory, size_t member) {
  (void)place;
  (void)values;
  memory += MEMORY_ROWS * member;
  return (effect_grip){.slides = 1,
                       .kept = memory[KEPT],
                       .value = memory[SHARE],
                       .by_motion = memory[BY_MOTION],
                       .by_parameter = {memory[BY_DISPLACEMENT]}};
}

const effect_type effect_presliding = {
    PRESLIDING_FACTS,   .kind = EFFECT_FRICTION,        .yields = 1,  .slides = 1, .state_count = state_count,
    .advance = advance, .advance_slope = advance_slope, .grip = grip,
};
