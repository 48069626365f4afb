#include "floating_point.h"

#include "sensor_fault.h"

#include <math.h>
#include <string.h>

#include "kernel_choice.h"

#define SPRING_ERROR      0.1  /* by which a spring may be stiffer or softer than described */
#define LEAST_RESOLUTIONS 10.0 /* that a sensor must miss to count as standing */

/* --- rows in use -------------------------------------------------------------------------------------------------- */

/* h_i = r_i·R⁺e_i: the share of a row in its own fit */
static double leverage_of(const tendonfmu_finger* f, size_t i) {
  double sum = 0.0;
  for (size_t j = 0; j < f->joints; ++j) {
    const size_t at = j * f->tendon_lanes + i;
    sum += f->derived.moment_arm[at] * f->scratch.inverse_routing[at];
  }
  return sum;
}

/* R⁺ ← R⁺ − R⁺e_i·(e_iᵀ − r_i·R⁺)/(1 − h_i): the least-squares fit without row i */
static void take_out(tendonfmu_finger* f, size_t i, double freedom) {
  const size_t n = f->joints, lanes = f->tendon_lanes;
  double* inverse = f->scratch.inverse_routing;
  double share[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < n; ++j) {
    share[j] = inverse[j * lanes + i] / freedom;
    inverse[j * lanes + i] = 0.0;
  }
  for (size_t l = 0; l < f->tendons; ++l) {
    double told = 0.0;
    for (size_t j = 0; j < n; ++j) {
      told += f->derived.moment_arm[j * lanes + i] * inverse[j * lanes + l];
    }
    for (size_t j = 0; j < n && l != i; ++j) {
      inverse[j * lanes + l] += share[j] * told;
    }
  }
}

void use_rows(tendonfmu_finger* f, const sensor_memory* sensor) {
  const finger_scratch* s = &f->scratch;
  const int by_tendons = source_of(f) == TENDONFMU_TENDON_POSITIONS;
  memcpy(s->inverse_routing, f->derived.inverse_routing, f->joints * f->tendon_lanes * sizeof(double));
  f->scratch.angles_determined = 1;
  for (size_t i = 0; i < f->tendons; ++i) {
    const double freedom = 1.0 - leverage_of(f, i);
    s->row_in_use[i] = 1.0;
    if (by_tendons && sensor[i].fault != SENSOR_IS_WELL) {
      if (freedom >= LEAST_FREEDOM) {
        take_out(f, i, freedom);
        s->row_in_use[i] = 0.0;
      } else {
        f->scratch.angles_determined = 0;
      }
    }
  }
  for (size_t i = 0; i < f->tendons; ++i) {
    const double leverage = by_tendons ? leverage_of(f, i) : 0.0, freedom = 1.0 - leverage;
    s->determined[i] = freedom >= LEAST_FREEDOM ? 1.0 : 0.0;
    s->leverage[i] = freedom >= LEAST_FREEDOM ? leverage / freedom : 0.0;
  }
}

void recall_rows(tendonfmu_finger* f) {
  if (f->derived.settings.watches_sensors) {
    use_rows(f, sensors_in(f->remembered.sensor));
  }
}

/* whether the torque of joint j, or its friction, reads the force of tendon i; joints with load friction read all */
static int joint_reads(const tendonfmu_finger* f, size_t j, size_t i) {
  const int has_load_friction = (f->shape.words[j] >> 3 & 3) != LAW_ABSENT;
  int reads = has_load_friction || f->derived.moment_arm[j * f->tendon_lanes + i] != 0.0;
  for (size_t r = 0; r < f->shape.extension_count; ++r) {
    const effect_place place = f->extensions.row[r].place;
    reads |= place.joint == j && place.tendon == i;
  }
  return reads;
}

/* joints whose torque, or the whole of them where the angles are not determined, cannot be trusted, into watch [N] */
static void find_blind_joints(const tendonfmu_finger* f, const sensor_memory* sensor, double* watch) {
  for (size_t j = 0; j < f->joints; ++j) {
    int blind = !f->scratch.angles_determined;
    for (size_t i = 0; i < f->tendons; ++i) {
      blind |= sensor[i].fault == FORCE_FAILS && joint_reads(f, j, i);
    }
    watch[j] = blind ? JOINT_BLIND : f->remembered.watch[j] == JOINT_BLIND ? JOINT_BEGINS_ANEW : JOINT_WATCHED;
  }
}

void weigh_forces(const tendonfmu_finger* f, const sensor_memory* sensor, double* weight) {
  size_t sound = 0;
  for (size_t i = 0; i < f->tendons; ++i) {
    sound += sensor[i].fault != FORCE_FAILS;
  }
  for (size_t i = 0; i < f->tendons; ++i) {
    weight[i] = sound == 0 ? 1.0 / (double)f->tendons : sensor[i].fault == FORCE_FAILS ? 0.0 : 1.0 / (double)sound;
  }
}

int any_joint_is_blind(const tendonfmu_finger* f) {
  for (size_t j = 0; f->derived.settings.watches_sensors && j < f->joints; ++j) {
    if (f->remembered.watch[j] == JOINT_BLIND) {
      return 1;
    }
  }
  return 0;
}

/* --- one tendon --------------------------------------------------------------------------------------------------- */

/* A tendon of this sample and the last. */
typedef struct watched {
  const sensor_memory* before; /* as the last sample left it, and on its way to what this one leaves */
  sensor_memory* now;
  double spring; /* y = k·(x0 − w) */
  double stiffness;
  int bidirectional;
  int again; /* w of this sample and the one before follow from the others, by the same rows */
  int well;  /* no fault up to now */
  int taut;
} watched;

/* it pulls, or may push as well: what it says of the angles is right */
static int is_taut(const tendonfmu_finger* f, size_t i) {
  return f->scratch.force[i] > f->derived.settings.spring_margin || f->derived.bidirectional[i] > 0.5;
}

/* a row in use that cannot be right: of a slack tendon or a failing sensor */
static int is_unsound(const tendonfmu_finger* f, size_t i) {
  const int fails = sensors_in(f->remembered.sensor)[i].fault != SENSOR_IS_WELL;
  return f->scratch.row_in_use[i] > 0.5 && (fails || !is_taut(f, i));
}

/* number of rows in use that cannot be right; none where the angles are measured */
static int count_unsound_rows(const tendonfmu_finger* f) {
  int count = 0;
  for (size_t i = 0; source_of(f) == TENDONFMU_TENDON_POSITIONS && i < f->tendons; ++i) {
    count += is_unsound(f, i);
  }
  return count;
}

/* w: what the other tendons say of this one's joint side */
static watched watch_tendon(const tendonfmu_finger* f, size_t i, int unsound, double joint_side) {
  watched w = {.before = sensors_in(f->remembered.sensor) + i,
               .now = sensors_in(f->scratch.sensor) + i,
               .stiffness = f->derived.stiffness[i],
               .bidirectional = f->derived.bidirectional[i] > 0.5,
               .taut = is_taut(f, i)};
  const int others = unsound - is_unsound(f, i), known = others <= 0 && f->scratch.determined[i] > 0.5;
  *w.now = *w.before;
  w.now->known = known;
  w.now->force = f->scratch.force[i];
  w.now->position = f->scratch.position[i];
  w.now->joint_side = joint_side;
  w.again = known && w.before->known > 0.5;
  w.well = w.before->fault == SENSOR_IS_WELL;
  w.spring = w.stiffness * (w.now->position - joint_side);
  return w;
}

/* more change of force within a sample than of the spring's length */
static int force_jumps(const finger_settings* settings, const watched* w) {
  const double stretched =
      fabs(w->now->position - w->before->position) + fabs(w->now->joint_side - w->before->joint_side);
  const double bound = (1.0 + SPRING_ERROR) * (w->stiffness * stretched) + settings->jump_margin;
  return w->again && w->well && fabs(w->now->force - w->before->force) > bound;
}

/* f0 that the spring should have, from a sample at which its tendon was taut */
static double force_of_spring(const watched* w) {
  const double force = w->now->taut_force + (w->spring - w->now->taut_spring);
  return force < 0.0 && !w->bidirectional ? 0.0 : force;
}

/* longer than this, s */
static int stood_for(double longest, double stood, double step) {
  return stood > longest + CLOCK_ROUNDING * step;
}

/* since when f0 is where it is, the last sample with a taut tendon, and whether it stands against its spring; stands:
 * set where it stands at all */
static int force_stands(const finger_settings* settings, const watched* w, double time, double step, int* stands) {
  sensor_memory* now = w->now;
  const int lost = w->well && !w->again;
  const int anew = lost || fabs(now->force - now->held_force) > settings->force_resolution;
  const int has_taut = !lost && now->has_taut > 0.5;
  const int taken = now->known > 0.5 && w->taut && w->well && (anew || !has_taut);
  if (anew) {
    now->held_force = now->force;
    now->force_held_since = time;
  }
  if (taken) {
    now->taut_force = now->force;
    now->taut_spring = w->spring;
  }
  now->has_taut = taken || has_taut;
  const double stood = time - now->force_held_since;
  const int long_enough = stood_for(settings->fault_hold_time, stood, step);
  *stands |= w->well && w->taut && long_enough;
  if (!w->again || !w->well || !has_taut) {
    return 0;
  }
  const double bound = settings->spring_margin + LEAST_RESOLUTIONS * settings->force_resolution;
  return (long_enough && fabs(force_of_spring(w) - now->force) > bound) ||
         (w->taut && stood_for(settings->longest_stand, stood, step));
}

/* since when x0 is where it is, and whether f0 and w contradict it */
static int position_stands(const finger_settings* settings, const watched* w, double time, double step) {
  sensor_memory* now = w->now;
  if ((w->well && !(w->again && w->taut)) || fabs(now->position - now->held_position) > settings->position_resolution) {
    now->held_position = now->position;
    now->position_held_since = time;
    now->force_then = now->force;
    now->joint_side_then = now->joint_side;
  }
  if (!w->again || !w->well || !stood_for(settings->fault_hold_time, time - now->position_held_since, step)) {
    return 0;
  }
  const double pulled = w->stiffness * (now->joint_side - now->joint_side_then);
  const double resolved = LEAST_RESOLUTIONS * settings->position_resolution * w->stiffness;
  const double allowed = resolved + settings->spring_margin + SPRING_ERROR * fabs(pulled);
  return fabs(now->force - now->force_then + pulled) > allowed;
}

/* a sensor begins to fail; what its spring was like before is kept */
static void begin_fault(const tendonfmu_finger* f, size_t i, sensor_fault_kind kind, int jumps, double time) {
  const sensor_memory* before = sensors_in(f->remembered.sensor) + i;
  sensor_memory* now = sensors_in(f->scratch.sensor) + i;
  const double stiffness = f->derived.stiffness[i];
  now->fault = kind;
  now->fault_since = now->unsound_at = time;
  if (kind == FORCE_FAILS && jumps) {
    now->taut_force = before->force;
    now->taut_spring = stiffness * (before->position - before->joint_side);
  } else if (kind == POSITION_FAILS) {
    now->taut_force = now->force_then;
    now->taut_spring = stiffness * (now->held_position - now->joint_side_then);
  }
}

/* the failing sensor has moved again and agrees with the spring */
static int agrees_again(const finger_settings* settings, const watched* w) {
  const sensor_memory* now = w->now;
  const double since = now->fault == POSITION_FAILS ? now->position_held_since : now->force_held_since;
  const double grown = fabs(w->spring - now->taut_spring);
  const double resolved = settings->force_resolution + settings->position_resolution * w->stiffness;
  const double allowed = settings->spring_margin + LEAST_RESOLUTIONS * resolved + SPRING_ERROR * grown;
  return now->known > 0.5 && w->taut && since > now->fault_since && allowed >= fabs(force_of_spring(w) - now->force);
}

/* a tendon whose sensor failed before: one that has agreed for recovery_time is well; returns whether it is */
static int recover(const finger_settings* settings, const watched* w, double time, double step) {
  sensor_memory* now = w->now;
  if (!agrees_again(settings, w)) {
    now->unsound_at = time;
  } else if (time - now->unsound_at + CLOCK_ROUNDING * step >= settings->recovery_time) {
    now->fault = SENSOR_IS_WELL;
    now->fault_since = now->unsound_at = 0.0;
    return 1;
  }
  return 0;
}

/* --- all tendons -------------------------------------------------------------------------------------------------- */

/* w of all tendons: x1 as the others have it, from z = x0 − f0/k, or from the measured angles */
static void find_joint_side(const tendonfmu_finger* f, double* joint_side) {
  const finger_scratch* s = &f->scratch;
  const double* angle = s->angle;
  _Alignas(32) double spring_end[MODEL_MAX_TENDONS], of_tendons[MODEL_MAX_JOINTS];
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    spring_end[i] = s->position[i] - s->force[i] * f->derived.inverse_stiffness[i];
  }
  if (source_of(f) == TENDONFMU_TENDON_POSITIONS) {
    f->kernel->multiply(f, s->inverse_routing, spring_end, of_tendons);
    angle = of_tendons;
  }
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    double all = 0.0;
    for (size_t j = 0; j < f->joints; ++j) {
      all += f->derived.moment_arm[j * f->tendon_lanes + i] * angle[j];
    }
    joint_side[i] = all - s->leverage[i] * (spring_end[i] - all);
  }
}

/* q of the sample before by the rows in use, times `sign`, added to angle_shift [N] */
static void shift_angles(const tendonfmu_finger* f, double sign) {
  const sensor_memory* before = sensors_in(f->remembered.sensor);
  _Alignas(32) double spring_end[MODEL_MAX_TENDONS], angle[MODEL_MAX_JOINTS];
  for (size_t i = 0; i < f->tendon_lanes; ++i) {
    spring_end[i] = before[i].position - before[i].force * f->derived.inverse_stiffness[i];
  }
  f->kernel->multiply(f, f->scratch.inverse_routing, spring_end, angle);
  for (size_t j = 0; j < f->joints; ++j) {
    f->scratch.angle_shift[j] += sign * angle[j];
  }
}

/* other rows give the angles from this sample on: those of the sample before, and what w is taken from, change too */
static void change_rows(tendonfmu_finger* f) {
  sensor_memory* now = sensors_in(f->scratch.sensor);
  if (source_of(f) == TENDONFMU_TENDON_POSITIONS) {
    shift_angles(f, -1.0);
    use_rows(f, now);
    shift_angles(f, 1.0);
    for (size_t i = 0; i < f->tendons; ++i) {
      now[i].known = 0.0;
    }
  }
}

/* whether a sensor fails or a joint is not watched, after this sample */
static int is_unwell(const tendonfmu_finger* f) {
  int any = 0;
  for (size_t i = 0; i < f->tendons; ++i) {
    any |= sensors_in(f->scratch.sensor)[i].fault != SENSOR_IS_WELL;
  }
  for (size_t j = 0; j < f->joints; ++j) {
    any |= f->scratch.watch[j] != JOINT_WATCHED;
  }
  return any;
}

void watch_sensors(tendonfmu_finger* f, double time, double step) {
  const finger_settings* settings = &f->derived.settings;
  const int unsound = count_unsound_rows(f), unwell = f->remembered.scalar[STATE_UNWELL] != 0.0;
  unsigned char jumps[MODEL_MAX_TENDONS], forces[MODEL_MAX_TENDONS], positions[MODEL_MAX_TENDONS];
  _Alignas(32) double joint_side[MODEL_MAX_TENDONS];
  int any_force = 0, standing = 0, changed = 0;
  clear_lanes(f->scratch.angle_shift, f->joint_lanes);
  clear_lanes(f->scratch.watch, f->joint_lanes);
  find_joint_side(f, joint_side);
  for (size_t i = 0; i < f->tendons; ++i) {
    const watched w = watch_tendon(f, i, unsound, joint_side[i]);
    jumps[i] = force_jumps(settings, &w);
    forces[i] = force_stands(settings, &w, time, step, &standing) || jumps[i];
    positions[i] = position_stands(settings, &w, time, step);
    any_force |= forces[i];
    changed |= unwell && !w.well && recover(settings, &w, time, step);
  }
  for (size_t i = 0; i < f->tendons && (any_force || !standing); ++i) { /* a force that stands is the likelier fault */
    if (any_force ? forces[i] : positions[i]) {
      begin_fault(f, i, any_force ? FORCE_FAILS : POSITION_FAILS, jumps[i], time);
      changed = 1;
    }
  }
  if (changed) {
    change_rows(f);
  }
  f->scratch.unwell = 0;
  if (changed || unwell) {
    find_blind_joints(f, sensors_in(f->scratch.sensor), f->scratch.watch);
    f->scratch.unwell = is_unwell(f);
  }
}

int sensors_are_finite(const tendonfmu_finger* f) {
  double probe = 0.0;
  for (size_t i = 0; i < f->tendons; ++i) {
    probe += 0.0 * (1e30 * sensors_in(f->scratch.sensor)[i].joint_side);
  }
  return probe == 0.0;
}

void remember_sensors(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  copy_lanes(s->sensor, f->scratch.sensor, SENSOR_NUMBERS * f->tendon_lanes);
  copy_lanes(s->watch, f->scratch.watch, f->joint_lanes);
  s->scalar[STATE_UNWELL] = f->scratch.unwell;
}

double mean_sound_force(const tendonfmu_finger* f) {
  double weight[MODEL_MAX_TENDONS], sum = 0.0;
  weigh_forces(f, sensors_in(f->scratch.sensor), weight);
  for (size_t i = 0; i < f->tendons; ++i) {
    sum += weight[i] * fabs(f->scratch.force[i]);
  }
  return sum;
}

void leave_unwatched(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    s->gain[j] = s->watch[j] == JOINT_WATCHED ? s->gain[j] : 0.0;
  }
}

void begin_bias_anew(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    s->bias[j] = s->watch[j] == JOINT_BEGINS_ANEW ? s->torque[j] - f->scratch.friction[j] : s->bias[j];
  }
}

void forget_unwatched(tendonfmu_finger* f) {
  const finger_state* s = &f->remembered;
  for (size_t j = 0; j < f->joints; ++j) {
    if (s->watch[j] != JOINT_WATCHED) {
      s->residual[j] = s->level[j] = s->joint_contact[j] = 0.0;
    }
  }
}
