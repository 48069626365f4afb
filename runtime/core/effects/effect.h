/* A term beyond the paper: a file for those of a kind, one row each in the table of effect_facts.c
 * (docs/reference/semantics/effects.md has the text they follow).
 *
 * A term acts in one of three ways: on the signals before the joint angles are known, on the friction values of some
 * places, or as a torque. It says what it remembers; the finger does the rest.
 *
 * Order within a sample: advance() computes what the effect will remember, from what the sample before left; then its
 * other calls read that. It becomes the finger's memory only when the sample is accepted, and derivatives asked for
 * afterwards read the same: whatever they need of the sample before must be in it. */
#pragma once

#include <stddef.h>
#include <stdint.h>

enum { EFFECT_MAX_PARAMETERS = 6 };

/* The effects that are linked, a bit each by its id: all, unless a program's build says which its fingers have. */
#ifndef TENDONFMU_EFFECTS
#define TENDONFMU_EFFECTS UINT64_MAX
#endif
#define EFFECT_IS_LINKED(id) ((uint64_t)(TENDONFMU_EFFECTS) >> id & 1)

#define EFFECT_NOWHERE 0xffffffffu

typedef enum place_need { PLACE_REFUSED, PLACE_OPTIONAL, PLACE_REQUIRED } place_need;

typedef enum place_rule {
  PLACES_AS_SAID,     /* each key by its own need */
  PLACES_EXACTLY_ONE, /* joint or tendon, not both */
  PLACES_AT_MOST_ONE, /* joint, tendon or neither */
  PLACES_NOT_LAST_JOINT,
  PLACES_LEVEL_ALONE /* level, or joint and tendon as said */
} place_rule;

typedef struct effect_parameter {
  const char* name;
  const char* unit;
  const char* unit_at_joint;   /* where it differs there; NULL: the same */
  const char* unit_everywhere; /* of a row without a place, where it differs there; NULL: the same */
  double minimum, maximum;
  unsigned char above_minimum; /* 1: the minimum itself is not allowed */
} effect_parameter;

/* What else is known of it, for those who read descriptions and estimate: no part of a program that does neither. */
typedef struct effect_expectation {
  double missing_value;    /* taken where the description leaves the key out; NaN: it must not */
  double scale;            /* expected magnitude where nothing is known; 0: a fit leaves it as it is */
  double scale_everywhere; /* of a row without a place; 0: the same */
} effect_expectation;

/* Where a row of the description's extensions acts; 0-based, EFFECT_NOWHERE where the key is absent. */
typedef struct effect_place {
  uint32_t joint, tendon, level;
} effect_place;

static inline int is_everywhere(effect_place place) {
  return place.joint == EFFECT_NOWHERE && place.tendon == EFFECT_NOWHERE && place.level == EFFECT_NOWHERE;
}

/* What an effect sees of a finger and one sample. Rows of [n × lanes] have a row a joint. */
typedef struct effect_sample {
  size_t joints, tendons, lanes;
  int first;                                /* 1: the first sample */
  double time, step;                        /* s; step is meaningless at the first sample */
  const double* angle;                      /* [n] rad */
  const double* velocity;                   /* [n] rad/s */
  const double* tendon_velocity;            /* [n × lanes] ẋ_ij, m/s; in advance() only */
  const double* force;                      /* [m] f0, N */
  const double* moment_arm;                 /* [n × lanes] r_ij, m */
  const double* rest_angle;                 /* [n] of the covers, rad; 0 without one */
  const double* axis_cosine;                /* [n × n] of the angle between the axes of two joints; 1 without links */
  double tendon_threshold, joint_threshold; /* v_min: m/s, rad/s */
} effect_sample;

/* r_ij */
static inline double arm_at(const effect_sample* sample, size_t joint, size_t tendon) {
  return sample->moment_arm[joint * sample->lanes + tendon];
}

/* sign of a velocity where it moves, else the one that was held before; 0 as long as it never moved */
static inline double held_side(const effect_sample* sample, double velocity, double threshold, const double* before) {
  if (velocity > threshold) {
    return 1.0;
  }
  if (velocity < -threshold) {
    return -1.0;
  }
  return sample->first ? 0.0 : *before;
}

/* A direction in the space of what a torque depends on: for derivatives. */
typedef struct effect_direction {
  const double *angle, *velocity, *force; /* [n], [n], [m] */
} effect_direction;

/* The signals of a sample while they are brought in order: rows that an effect may change. */
typedef struct effect_signals {
  size_t joints, tendons;
  int first, source;
  int late; /* 0: before the joint angles are known (source 1) or taken as given; 1: after */
  double time;
  double *force, *position;        /* [m] f0, x0 */
  double *angle, *velocity;        /* [n]; velocity with source 3 only */
  const double* inverse_stiffness; /* [m] 1/k, m/N */
} effect_signals;

/* A factor of the friction at one place, of F and of b. */
typedef struct effect_grip {
  double value;
  double by_velocity; /* s/m or s/rad */
} effect_grip;

/* EFFECT_MEMORY: numbers alone, which friction_memory.c reads. */
typedef enum effect_kind { EFFECT_TORQUE, EFFECT_FRICTION, EFFECT_SIGNAL, EFFECT_MEMORY } effect_kind;

typedef struct effect_action effect_action;

/* One row of the description's extensions. */
typedef struct extension_row {
  const effect_action* action;
  effect_place place;
  const double* parameters;
  const double* before; /* what the sample before left */
  double* now;          /* what this one leaves; between samples the last one */
  size_t memory_count;  /* numbers of these two */
} extension_row;

/* What an effect does. */
struct effect_action {
  effect_kind kind;
  int order; /* of signals: rows act in the order of these, whatever theirs */

  /* Numbers that it remembers, part of the finger's state block: so many, or what state_count() says of a finger of n
   * joints and m tendons. */
  size_t memory_count;
  size_t (*state_count)(size_t joints, size_t tendons, effect_place place);
  /* now ← what it remembers once this sample is accepted; NULL with no memory, and of signals. Called when the
   * kinematics are known. */
  void (*advance)(const extension_row* row, const effect_sample* sample);

  /* --- EFFECT_TORQUE ------------------------------------------------------------------------------------------------
   * torque() adds to torque [n], N·m; */
  void (*torque)(const extension_row* row, const effect_sample* sample, double* torque);
  /* adds its derivative along a direction; the memory is held fixed except for what it says of this sample. NULL: 0. */
  void (*slope)(const extension_row* row, const effect_sample* sample, const effect_direction* direction,
                double* slope);
  /* Of friction: the slot with whose velocity number k of its memory has its sign. Where friction has a memory there,
   * the number builds up as friction of this size would; at joints the size enters the limit there, and the number is
   * 0. torque() must be linear in the memory; NULL: not so. */
  size_t (*slot)(const extension_row* row, size_t joints, size_t lanes, size_t k);
  double (*size)(const extension_row* row, const effect_sample* sample); /* N, N·m */

  /* --- EFFECT_FRICTION ----------------------------------------------------------------------------------------------
   * member: which of the velocities of its place: 0 of a joint, the joint (0-based) of a tendon's; of a finger's
   * joint·m + tendon, and after all of these n·m + joint for the joints' own */
  effect_grip (*grip)(const extension_row* row, size_t member);

  /* --- EFFECT_SIGNAL ------------------------------------------------------------------------------------------------
   * Changes signals, twice a sample (late 0, then 1), and fills now; */
  void (*signal)(const extension_row* row, effect_signals* signals);
  /* turns a direction of what it was given into that of what it made of it. */
  void (*signal_pass)(const extension_row* row, effect_signals* direction);
};

/* A row of the table of effects. */
typedef struct effect_type {
  const char* name;            /* as in a description */
  unsigned char id;            /* in the model image, below 64; never reused */
  unsigned char joint, tendon; /* place_need */
  unsigned char rule;          /* place_rule */
  unsigned char level;         /* 1: it may stand at a level */
  unsigned char most;          /* rows of the same place; 0: any number */
  unsigned char one_of;        /* of its first numbers exactly one is above 0; 0: no such rule */
  /* 0 and NULL where it is not linked */
  unsigned char parameter_count;
  const effect_parameter* parameters;
  const effect_action* action;
} effect_type;

/* Row by id, whether it is linked or not; NULL when there is none. */
const effect_type* effect_by_id(uint32_t id);

/* Row by position 0.., NULL past the end. */
const effect_type* effect_at(size_t position);

/* Of number `offset` of an effect. */
const effect_expectation* effect_expectation_of(const effect_type* effect, uint32_t offset);
