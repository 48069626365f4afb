/* Everything a finger consists of, laid out in one block of memory.
 *
 * Lanes: tendons lie side by side in rows of M = 4·⌈m/4⌉, joints in rows of N = 4·⌈n/4⌉; lanes without a tendon or
 * joint have forces, moment arms, velocities and residuals of zero, so nothing of them reaches an output. Slots: every
 * relative velocity has one slot, n rows of tendon lanes (ẋ_ij, eq. 5) and then a row of joint lanes (q̇_j). The
 * friction effects that share a velocity (F_B before joint j and F_A of pulley j−1; T_jv0 and T_jvf) move and stick
 * together, so what fig. 5 remembers of an effect is kept once per slot. */
#pragma once

#include <string.h>

#include "contact_bands.h"
#include "effect_facts.h"
#include "friction_law.h"
#include "link_geometry.h"
#include "model_image.h"
#include "tendonfmu.h"

enum { ERROR_BYTES = 400 };

/* What is remembered stays so small that a square of it, and a sum of some squares, is finite: sums of torques (N·m)
 * and squares. */
#define LARGEST_SUM    1e150
#define LARGEST_SQUARE 1e300

/* Beyond this, in magnitude, no input is a measurement; below it no product in a step overflows for sane parameters. */
#define LARGEST_INPUT  1e12
#define LARGEST_TIME   1e15 /* s */
#define CLOCK_ROUNDING 0.01 /* of a step: times so near are equal (docs/reference/semantics/README.md#clocks) */

/* Numbers of the description that are neither per joint nor per tendon. */
typedef struct finger_settings {
  double tendon_threshold, joint_threshold; /* v_min: m/s, rad/s */
  double cutoff_rate;                       /* 2π·cutoff, 1/s; 0 unfiltered */
  double drift_variance, noise_std, noise_std_per_force, forget_rate;
  double initial_variance; /* < 0: from the noise at the first sample */
  double noise_time;       /* < 0: noise per sample */
  int has_initial_torque;
  double fault_hold_time, longest_stand, recovery_time; /* s */
  double force_resolution, jump_margin, spring_margin;  /* N */
  double position_resolution;                           /* m */
} finger_settings;

/* The rows by what they act on, those of each kind in the description's order; friction and torques side by side. */
typedef struct extension_rows {
  extension_row *signal, *friction, *torque, *memory;
  size_t signals, frictions, torques, memories; /* how many of each */
  int gripped; /* friction or memory rows: F at a slot is not what fig. 5 gives alone */
} extension_rows;

/* One of the elements side by side, by slot [n × M + N]; the edge and the pulley of a slot share its numbers. */
typedef struct friction_element {
  double* share;                    /* w; 0: there is no such element */
  double *stiffness, *per_distance; /* κ, 0 in relative form; 1/D, 0 in absolute form */
  double* relaxation_time;          /* T; 0: none */
  double* follows;                  /* p, of the friction held, by the limit */
  double *kept, *stiff, *soft;      /* a, g·κ, g/D of the present step */
} friction_element;

/* Places whose friction has a memory. */
typedef struct friction_memory {
  double compliance; /* of the cords, 1/k_c, m/N; 0: rigid */
  double stretch;    /* the same in the present step: 0 in the first */
  int relaxes;       /* some place has a relaxation time */
  int follows;       /* at some place p > 0 */
  double filtered;   /* share of the travel that comes from the filtered velocity */
  double step;       /* that kept, stiff, soft are of, s */
  double* remembers; /* [n × M + N] 1 or 0 */
  double* sections;  /* [n × M + N] S, of the cord from a level to the tendon's end */
  friction_element element[MODEL_MAX_ELEMENTS];
} friction_memory;

/* All that follows from the parameters; filled in one place, derived_numbers.c. Arrays of [n × M] have a row a joint.
 */
typedef struct derived_numbers {
  finger_settings settings;
  double* stiffness;         /* [M] k; 0 in spare lanes */
  double* inverse_stiffness; /* [M] 1/k */
  double* bidirectional;     /* [M] 1 or 0 */
  double* tendon_zero;       /* [M] taken from x0 */
  double* moment_arm;        /* [n × M] r_ij */
  double* inverse_routing;   /* [n × M] R⁺ */
  double* pulley_law;     /* [n × M × LAW_NUMBERS] row j: the pulley whose tendon moves with slot j, at joint j−1 */
  double* edge_law;       /* [records × LAW_NUMBERS] per edge with K laws K+2 records: L1 L1 L2 … LK LK */
  double* edge_segment;   /* [records × 2] angle at which the segment begins, 1/length; 0 outside the grid */
  double* edge_angle;     /* per joint: [most points × M], ∞ where an edge has fewer */
  size_t* edge_angle_row; /* [n] where the angles of a joint begin, in numbers */
  unsigned char* can_hold; /* [n × M / 4] 0: |F| of the four slots is at no joint, their moment arms are 0 */
  uint32_t* edge_record;   /* [n × M] first record of the edge; 0 holds zeros for edges without friction */
  double* joint_law;       /* [N × LAW_NUMBERS] T_jv0 */
  double* load_law;        /* [N × LAW_NUMBERS] T_jvf */
  double *cover_stiffness, *cover_rest;          /* [N] */
  double *contact_threshold, *contact_per_force; /* [N] */
  double* initial_torque;                        /* [N] */
  double *deviation, *deviation_per_force;       /* [N] */
  double* band_square; /* [n × BAND_NUMBERS × BANDS] squares of the numbers of contact.bands */
  double* load_arm;    /* [n × M] r_ij·k_i; this and the one before with contact.bands only */
  link_geometry links; /* arrays NULL without links */
  int* least_link;     /* [n] of find_least_links() */
  double* axis_cosine; /* [n × n] between the axes of two joints, 1 without links; with extensions only */
} derived_numbers;

/* What the finger remembers from sample to sample, with the outputs of the last one: one plain run of doubles. */
enum {
  STATE_INITIALISED,     /* 0 or 1 */
  STATE_SOURCE,          /* kinematics source 1, 2, 3 */
  STATE_TIME,            /* s */
  STATE_FIRST_SAMPLE,    /* 1 while the last sample is the first */
  STATE_VELOCITY_GAIN,   /* ∂v_k/∂q_k of the last sample, 1/s */
  STATE_CONTACT,         /* 0 or 1 */
  STATE_ABSORBED,        /* Λ: Σ −ln(1 − K) over the updates of the bias */
  STATE_ABSORBED_BEFORE, /* the same before the last sample's update */
  STATE_UNWELL,          /* 1 where a sensor fails or a joint is not watched; with sensor_fault, else 0 */
  STATE_STEP,            /* Δt of the last sample, s; 0 of the first */
  STATE_SCALARS = 12     /* a multiple of 4: the rows stay aligned */
};

typedef enum sensor_fault_kind { SENSOR_IS_WELL, FORCE_FAILS, POSITION_FAILS } sensor_fault_kind;

/* What sensor_fault remembers of the tendons, [M] each, one run. */
typedef struct sensor_memory {
  double* fault;                               /* sensor_fault_kind */
  double* fault_since;                         /* s; 0 without a fault */
  double* unsound_at;                          /* s, last sample of a fault that the springs contradict; 0 without */
  double* known;                               /* 1 where w follows from the others, with the rows still in use */
  double *force, *position, *joint_side;       /* f0, x0 and w of the last sample: N, m, m */
  double *held_force, *force_held_since;       /* N, from which f0 has not gone by more than its resolution; s */
  double* has_taut;                            /* 1 where the next two are known */
  double *taut_force, *taut_spring;            /* N, f0 and y = k·(x0 − w) of a sample with a taut tendon */
  double *held_position, *position_held_since; /* m, the same of x0; s */
  double *force_then, *joint_side_then;        /* N, m: f0 and w when x0 was there first */
} sensor_memory;

enum { SENSOR_NUMBERS = sizeof(sensor_memory) / sizeof(double*) };

/* What a joint whose torque a failing sensor falsifies remembers. */
typedef enum joint_watch { JOINT_WATCHED, JOINT_BLIND, JOINT_BEGINS_ANEW } joint_watch;

typedef struct finger_state {
  double* scalar; /* [STATE_SCALARS] */
  /* [N] per joint */
  double *angle, *speed, *torque, *friction, *compensated, *bias, *joint_contact;
  double* variance;       /* P, (N·m)² */
  double* gain;           /* K; 0 where the bias is not updated */
  double* residual;       /* r before the update */
  double* level;          /* contact_level */
  double* total_variance; /* square of compensated_torque_std */
  /* [M] per tendon */
  double *force, *slack;
  /* [n × M + N] per slot, fig. 5 */
  double* moving; /* 1 or 0 at the last sample */
  double* side;   /* sgn(v) of the last moving sample; 0: never moved */
  double* event;  /* of the last sample: 1 came to rest, s − 2 began to move after moving to side s, 0 neither */
  double *stuck_since, *last_stuck; /* s */
  double* jumped;                   /* [N] Σ Δb, N·m; this and the next with contact.bands only */
  double* bands;                    /* [N] band_memory */
  sensor_memory sensor;             /* this and the next with sensor_fault only */
  double* watch;                    /* [N] joint_watch of the last sample */
  /* with a memory of friction only; edges in the first row of slots, pulleys in the second */
  double* element;               /* [elements × 2 × (n × M + N)] F of each element, N, N·m */
  double *by_turning, *by_limit; /* [2 × (n × M + N)] ∂F/∂c0, ∂F/∂lim of the last sample */
  double* held_limit;            /* [2 × (n × M + N)] lim, N, N·m */
  double* tension;               /* [2 × (n × M + N)] f behind a place, N; with cord_stretch only */
  double* extension;             /* as the extensions ask for */
} finger_state;

/* What a row has so many numbers of. */
typedef enum row_unit {
  OF_FINGER,
  OF_JOINTS,   /* N */
  OF_TENDONS,  /* M */
  OF_MATRIX,   /* n × M */
  OF_SLOTS,    /* n × M + N */
  OF_ELEMENTS, /* slots, of each element side by side */
  OF_PARAMETERS,
  OF_RECORDS,   /* laws of the edges, as edge_law has them */
  OF_ANGLES,    /* working points of the edges, most points × M a joint */
  OF_EXTENSIONS /* what they remember */
} row_unit;

/* Of what finger it is a part, NULL in any other: of one with an option (MODEL_HAS_LINKS, …), or with these. */
typedef enum row_condition {
  WITH_EXTENSIONS = MODEL_OPTION_BITS + 1,
  WITH_MEMORY = 2 * WITH_EXTENSIONS, /* of friction */
  WITH_TWO_ELEMENTS = 2 * WITH_MEMORY,
  WITH_CORDS = 2 * WITH_TWO_ELEMENTS /* that stretch */
} row_condition;

/* What a number in a saved state may be at most or, with MINUS, at least. */
typedef enum state_bound {
  ZERO,
  ONE,
  TWO,
  THREE,
  A_TIME, /* LARGEST_TIME, … */
  TWO_TIMES,
  A_SUM,
  TWO_SUMS,
  A_SQUARE,
  ANY_NUMBER, /* that is finite */
  MINUS = 0x80
} state_bound;

/* Rows of numbers, each with a pointer in struct tendonfmu_finger: all of its memory follows from such. */
typedef struct finger_row {
  uint16_t place;         /* offset of the first pointer */
  uint16_t when;          /* an option, row_condition, or 0: always */
  unsigned char pointers; /* how many side by side */
  unsigned char count;    /* of the unit; 0: 1 */
  unsigned char unit;     /* row_unit */
  /* what may stand in a saved state */
  unsigned char whole;            /* whole numbers only */
  unsigned char spare;            /* lanes that stand for nothing are tracked along; else they hold 0 */
  unsigned char low, high;        /* state_bound */
  const struct finger_row* parts; /* [count] where each has limits of its own */
} finger_row;

/* The state in its order. */
extern const finger_row state_rows[];
extern const size_t state_row_count;

/* The laws of four neighbouring slots as they look at present: on the side to which each lane moves, and between the
 * working points among which the joint before stands. A view is valid until a velocity changes sign or the angle leaves
 * [low, high); most samples find it valid. Rows of four lanes; laws by number (LAW_COULOMB, …). */
typedef struct slot_view {
  double key[4];          /* bits of the negative sides; −1: to be filled. This and the next in lane 0 for */
  double blends[4];       /* all, in plain C in each lane; 1 where one stands between two working points */
  double low[4], high[4]; /* rad */
  double begin[4], inverse_length[4]; /* of the segment: rad, 1/rad; 0 outside the grid */
  double below[LAW_SIDE_NUMBERS][4];  /* F_B at the working point below; joints: T_jv0 */
  double above[LAW_SIDE_NUMBERS][4];  /* F_B at the one above */
  double other[LAW_SIDE_NUMBERS][4];  /* F_A of the pulley with the same velocity; joints: T_jvf */
} slot_view;

/* Of one sample only; nothing in it decides what the next one gives. */
typedef struct finger_scratch {
  double *force, *position;        /* [M] inputs, padded */
  double* slack;                   /* [M] */
  double* velocity;                /* [n × M + N] */
  slot_view* view;                 /* [(n × M + N) / 4] */
  double *edge, *pulley;           /* [n × M] F_B, F_A; pulley in the row of its slot */
  double *edge_bias, *pulley_bias; /* [n × M] b of the same */
  double *force_at,
      *force_between; /* [n × M] f_A before each joint and f_B, as they multiply an F: |f| if bidirectional */
  double* angle;      /* [N] */
  double *torque, *friction, *bias_step, *load;                    /* [N] τ, T, Δb, Σ f_B */
  double *joint_friction, *load_friction, *joint_bias, *load_bias; /* [N] T_jv0, T_jvf and their b */
  double* residual_variance;                                       /* [N] S, (N·m)²; of a guided sample only */
  /* with contact.bands only */
  double *edge_limit, *pulley_limit; /* [n × M + N] |F| of the law, whether it acts or not; joints T_jv0, T_jvf */
  double *slip_torque, *limit;       /* [N] friction of eq. (10), all that it can be: B, N·m */
  double* motor_load;                /* [N] x, N·m */
  double* unknown;                   /* [N] max(V, W) before this sample, N·m */
  double* young;                     /* [N] of a mean that began with this joint's, instead of those in shares */
  band_shares* shares;               /* of the last step */
  /* with sensor_fault only */
  sensor_memory sensor;      /* as in the state, after this sample */
  double* inverse_routing;   /* [n × M] R⁺ of the rows in use */
  double* leverage;          /* [M] h/(1 − h) of the rows in use; 0 of the others */
  double* determined;        /* [M] 1: the others determine the angles */
  double* row_in_use;        /* [M] 1 or 0; 0 where the angles are measured */
  double* watch;             /* [N] as in the state, after this sample */
  double* angle_shift;       /* [N] rad, by which the angles of the sample before change with the rows in use */
  int angles_determined;     /* no row in use belongs to a failing sensor */
  int unwell;                /* as in the state, after this sample */
  double* extension;         /* the memory of the extensions after this sample */
  double *grip, *grip_slope; /* [n × M + N] what friction rows make of F and b, and ∂/∂v; with extensions only */
  double* bias_grip;         /* [n × M + N] the same of b: 0 where nothing sticks */
  /* with a memory only */
  double* own_limit; /* [N] N·m, what torque rows add to the limit of a joint */
  double* travelled; /* [n × M + N] Δ */
  double *element, *by_turning, *by_limit, *held_limit, *tension; /* as in the state, after this sample */
  effect_sample sample;                                           /* as the extensions see it */
} finger_scratch;

typedef struct step_kernel step_kernel;

/* One sample of tendonfmu_run_guided(); all 0 in every other call. */
typedef struct sample_guide {
  int guides;                 /* the caller says what the bias learns from, contact does not */
  int begins;                 /* it has not learned yet: it begins with this sample */
  int learns;                 /* step 6 is taken */
  const double* known_torque; /* [n] N·m, or NULL */
} sample_guide;

struct tendonfmu_finger {
  model_shape shape;
  size_t joints, tendons;           /* n, m */
  size_t joint_lanes, tendon_lanes; /* N, M */
  size_t slots;                     /* n·M + N */
  uint64_t image_id;                /* checksum of the image */
  const step_kernel* kernel;
  double *start, *candidate, *parameters; /* [p] of the image, being checked, in force */
  size_t prepared_bytes;                  /* from `parameters` on: these and all arrays that follow from them */
  double* state;                          /* [state_count], what `remembered` points into */
  double* next; /* [next_count], the end of the state after this sample, from what sensor_fault remembers on */
  size_t state_count, next_count;
  extension_rows extensions;
  friction_memory memory;
  derived_numbers derived;
  finger_state remembered;
  finger_scratch scratch;
  sample_guide guide;
  void* allocation; /* of tendonfmu_create(), NULL in the caller's memory */
  char error[ERROR_BYTES];
};

/* Of four sums over every fourth lane of a row, in the order of the kernels (quad.h). */
static inline double sum_of_lanes(const double of[4]) {
  return (of[0] + of[2]) + (of[1] + of[3]);
}

/* Whether the description has any of these parts (MODEL_HAS_LINKS, …). */
static inline int has_option(const tendonfmu_finger* finger, uint32_t options) {
  return (finger->shape.options & options & (TENDONFMU_OPTIONS)) != 0;
}

/* How many elements of friction with a memory stand side by side at most; 0: there is none. */
static inline size_t elements_of(const tendonfmu_finger* finger) {
  return PRESLIDING_IS_LINKED ? finger->shape.elements : 0;
}

/* What a joint's bands remember. */
static inline band_memory* bands_of(const tendonfmu_finger* finger, size_t joint) {
  return (band_memory*)(void*)finger->remembered.bands + joint;
}

static inline int is_first(const tendonfmu_finger* finger) {
  return finger->remembered.scalar[STATE_INITIALISED] == 0.0;
}

/* Angle of a joint at the sample before, by the rows that are in use now. */
static inline double angle_before_step(const tendonfmu_finger* finger, size_t joint) {
  const double angle = finger->remembered.angle[joint];
  return has_option(finger, MODEL_HAS_SENSOR_FAULT) ? angle + finger->scratch.angle_shift[joint] : angle;
}

/* Rows of lanes: four at once, for which no library is called. */
static inline void copy_lanes(double* to, const double* from, size_t lanes) {
  for (size_t i = 0; i < lanes; i += 4) {
    memcpy(to + i, from + i, 4 * sizeof *to);
  }
}

static inline void clear_lanes(double* row, size_t lanes) {
  for (size_t i = 0; i < lanes; i += 4) {
    memset(row + i, 0, 4 * sizeof *row);
  }
}

/* Where joint angles and velocities come from: TENDONFMU_TENDON_POSITIONS, … */
static inline int source_of(const tendonfmu_finger* finger) {
  return (int)finger->remembered.scalar[STATE_SOURCE];
}

/* Share of the travel that comes from the velocity, filtered or measured; the rest is how the angle changed. */
static inline double filtered_travel(const tendonfmu_finger* finger) {
  return source_of(finger) == TENDONFMU_JOINT_VELOCITIES ? 1.0 : finger->memory.filtered;
}

static inline int uses_positions(const tendonfmu_finger* finger) {
  return source_of(finger) == TENDONFMU_TENDON_POSITIONS ||
         has_option(finger, MODEL_WATCHES_MOTORS | MODEL_HAS_SENSOR_FAULT);
}

/* R⁺ as the kinematics use it */
static inline const double* inverse_in_use(const tendonfmu_finger* finger) {
  return has_option(finger, MODEL_HAS_SENSOR_FAULT) ? finger->scratch.inverse_routing : finger->derived.inverse_routing;
}

/* v_min of a slot: m/s, rad/s */
static inline double threshold_of(const tendonfmu_finger* finger, size_t slot) {
  const finger_settings* settings = &finger->derived.settings;
  return slot < finger->joints * finger->tendon_lanes ? settings->tendon_threshold : settings->joint_threshold;
}

/* Side before the last sample of a slot that rested then, or rests now. */
static inline double side_before(const tendonfmu_finger* finger, size_t slot) {
  const double event = finger->remembered.event[slot];
  return event < 0.0 ? event + 2.0 : finger->remembered.side[slot];
}

/* Exponent of forgetting of a slot: exp(−this) of what it brought along when it came to rest counts when it begins to
 * move. absorbed: Λ until then. */
static inline double rest_exponent(const tendonfmu_finger* finger, size_t slot, double absorbed) {
  const finger_state* s = &finger->remembered;
  const double since = s->stuck_since[slot];
  return has_option(finger, MODEL_FORGETS_BY_ABSORPTION)
             ? absorbed - since
             : finger->derived.settings.forget_rate * (s->last_stuck[slot] - since);
}

/* How many of a unit stand behind each pointer of a row, 0 where the finger lacks it, and how long that is. */
size_t row_count(const tendonfmu_finger* finger, const finger_row* row);
size_t unit_length(const tendonfmu_finger* finger, row_unit unit);

/* Bytes needed for a finger of a checked image header. */
size_t finger_memory_size(const model_shape* shape);

/* Lays a finger of a checked image header into memory of that size, all zeros; words receives room for the shape words.
 */
tendonfmu_finger* finger_lay_out(const model_shape* shape, void* memory, uint32_t** words);

/* --- what follows from the parameters (derived_numbers.c), the one place where it is computed -----------------------
 */

/* Recomputes finger->derived from finger->parameters: at creation, and after parameters were written or restored.
 * R⁺ is only computed again where `routing_changed`. */
void derive_numbers(tendonfmu_finger* finger, int routing_changed);

/* Copies parameters and all that follows from them, of a finger of the same image. */
void take_prepared_numbers(tendonfmu_finger* finger, const tendonfmu_finger* prepared);

/* What scratch keeps between samples, from the state: after parameters, state or kernel changed, or a sample was
 * refused half way. The next sample looks at all laws anew. */
void recall_sample(tendonfmu_finger* finger);

/* --- the laws in force at a slot (derived_numbers.c): the side by the sign of its velocity, the working points by the
 * joint angle --- */

/* Fills the view of `count` slots from `slot` on: its lanes from slot % 4 on.
 *   angle         of the joint before (q_0 = 0); of no meaning to the slots of joints
 *   negative      one bit a lane: the law's side for v < 0 */
void slot_view_fill(const tendonfmu_finger* finger, size_t slot, size_t count, double angle, int negative,
                    slot_view* view);

/* Segment of a grid in which an angle lies, as the number of working points at or below it. */
size_t slot_segment(const tendonfmu_finger* finger, size_t joint, size_t tendon, double angle);

/* Laws of one effect: a single one, or those of the segment between two working points. */
typedef struct effect_laws {
  const double *below, *above; /* above NULL: no working points */
  dual weight;                 /* of the one above */
} effect_laws;

effect_laws edge_laws(const tendonfmu_finger* finger, size_t joint, size_t tendon, dual angle);

/* |F| of an effect at a speed >= 0, on its side for v > 0 or v < 0. */
dual magnitude_at(const effect_laws* laws, int negative, dual speed);
