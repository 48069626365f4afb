/* TendonFMU: friction of a whole tendon-driven finger, and the torque that is left when it is subtracted.
 *
 *   image  = tendonfmu_image_from_json(...)        tendonfmu_description.h, or `tendonfmu build`
 *   finger = tendonfmu_create(image, size, ...)
 *   tendonfmu_initialise(finger, t0, &inputs)      takes the first sample
 *   tendonfmu_step(finger, t, &inputs)             takes the sample at t
 *   tendonfmu_get_outputs(finger, &outputs)        belong to the sample last taken
 *
 * Conventions that hold for every function below
 *   Units      SI: N, m, rad, s, N·m. Arrays of n (joints) or m (tendons) numbers, base first.
 *   Ownership  The caller owns every pointer it passes; nothing is kept beyond the call, except the memory
 *              given to tendonfmu_place(), which the finger lives in until the caller takes it back.
 *   Threads    A finger may be used by one thread at a time. Different fingers share nothing.
 *   Real time  initialise, step, step_hand, run, get_*, set_*, take_parameters, save_state, restore_state and reset
 * allocate nothing, take no lock and make no system call. Only tendonfmu_create() and tendonfmu_destroy() use the heap.
 *   Errors     A function that fails returns a status other than TENDONFMU_OK, leaves the finger as it was, and
 *              says why in one line in tendonfmu_last_error().
 *   Host       Floating-point mode, locale, signals and working directory are neither changed nor relied on.
 *
 * The equations are those of the paper; the rules of a sample are docs/reference/semantics/README.md. */
#ifndef TENDONFMU_H
#define TENDONFMU_H

#include <stddef.h>

#include "tendonfmu_outputs.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum tendonfmu_status {
  TENDONFMU_OK = 0,
  TENDONFMU_BAD_ARGUMENT = 1,  /* a null pointer, an index or a size out of range */
  TENDONFMU_BAD_IMAGE = 2,     /* not a model image, damaged, or a finger that cannot be */
  TENDONFMU_BAD_PARAMETER = 3, /* a value out of its range, or fixed and already in use */
  TENDONFMU_BAD_SAMPLE = 4,    /* not finite, out of range, or time going back */
  TENDONFMU_BAD_STATE = 5,     /* saved bytes that are damaged or of another finger */
  TENDONFMU_WRONG_ORDER = 6    /* a step before the initialisation, or a second initialisation */
} tendonfmu_status;

typedef enum tendonfmu_kinematics_source {
  TENDONFMU_TENDON_POSITIONS = 1, /* q = R⁺(x0 − f0/k), q̇ by the velocity filter (eqs. 2, 4) */
  TENDONFMU_JOINT_POSITIONS = 2,  /* q measured, q̇ by the velocity or position filter */
  TENDONFMU_JOINT_VELOCITIES = 3  /* q and q̇ measured */
} tendonfmu_kinematics_source;

/* One finger: model, parameters and state in one block of memory. Opaque. */
typedef struct tendonfmu_finger tendonfmu_finger;

/* Version of the library, "major.minor.patch". Static text. */
const char* tendonfmu_version(void);

/* --- Creation -------------------------------------------------------------------------------------------------- */

/* Checks header, checksum and shape of a model image: a flat, versioned block of little-endian numbers
 * (core/model_image.h). Its values are checked by tendonfmu_place() and tendonfmu_create(), which have room for them.
 *   image         [image_size] bytes, any alignment, not modified
 *   message       [message_size] receives one line when the image is refused; may be NULL when message_size is 0
 * Returns TENDONFMU_OK, TENDONFMU_BAD_IMAGE or TENDONFMU_BAD_ARGUMENT. */
tendonfmu_status tendonfmu_check_image(const void* image, size_t image_size, char* message, size_t message_size);

/* Bytes of memory that a finger of this image needs; 0 when the image is refused. */
size_t tendonfmu_memory_size(const void* image, size_t image_size);

/* Places a finger into memory of the caller: no allocation, for microcontrollers and real-time start-up.
 *   memory        [memory_size >= tendonfmu_memory_size()] bytes, any alignment; must not be moved while in use
 * The image is copied and may be freed afterwards. Creation, tendonfmu_reset(), restoring a state with other parameters
 * and writing moment arms use up to 24 KiB of stack; every other call less than 8 KiB. Returns NULL when refused, with
 * the reason in message. */
tendonfmu_finger* tendonfmu_place(void* memory, size_t memory_size, const void* image, size_t image_size, char* message,
                                  size_t message_size);

/* The same in memory from one malloc(), to be freed by tendonfmu_destroy(). */
tendonfmu_finger* tendonfmu_create(const void* image, size_t image_size, char* message, size_t message_size);

/* Frees a finger of tendonfmu_create(). NULL is allowed. Never for a finger of tendonfmu_place(). */
void tendonfmu_destroy(tendonfmu_finger* finger);

/* Writes "{xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx}" and a zero: an identifier of the image's content, the same on every
 * machine. salt is mixed in (any number). Nothing is checked but the pointers. */
tendonfmu_status tendonfmu_image_guid(const void* image, size_t image_size, unsigned long long salt, char guid[39]);

/* Number of joints n (1..16) and tendons m (1..64). */
size_t tendonfmu_joint_count(const tendonfmu_finger* finger);
size_t tendonfmu_tendon_count(const tendonfmu_finger* finger);

/* 1 when the description has links, so that outputs from fingertip_force on mean something. */
int tendonfmu_has_links(const tendonfmu_finger* finger);

/* 1 when the description has contact.watches_motors: tendon_position is then needed with every kinematics source. */
int tendonfmu_watches_motors(const tendonfmu_finger* finger);

/* 1 when the description has sensor_fault, so that sensor_fault and contact_observable mean something; tendon_position
 * is then needed with every kinematics source. */
int tendonfmu_watches_sensors(const tendonfmu_finger* finger);

/* One line about the last call that failed on this finger, "" when none has. Valid until the next call. */
const char* tendonfmu_last_error(const tendonfmu_finger* finger);

/* --- Samples --------------------------------------------------------------------------------------------------- */

/* Inputs of one sample, or of many (tendonfmu_run): row-major [samples × m] or [samples × n].
 * joint_position may be NULL for source 1, joint_velocity for sources 1 and 2, tendon_position for 2 and 3 without
 * sensor_fault. */
typedef struct tendonfmu_inputs {
  const double* tendon_force;    /* [m] N    f0, tension at the spring; negative only on bidirectional tendons */
  const double* tendon_position; /* [m] m    x0, motor side */
  const double* joint_position;  /* [n] rad  q */
  const double* joint_velocity;  /* [n] rad/s */
} tendonfmu_inputs;

/* Chooses where joint angles and velocities come from. Default 1. Before tendonfmu_initialise() only. */
tendonfmu_status tendonfmu_set_kinematics_source(tendonfmu_finger* finger, int source);
int tendonfmu_get_kinematics_source(const tendonfmu_finger* finger);

/* Takes the first sample. Values must be finite and of magnitude at most 1e12. */
tendonfmu_status tendonfmu_initialise(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs);

/* Takes the sample at `time`. A time equal to that of the sample already taken changes nothing; an earlier one, or a
 * value that is not finite, is TENDONFMU_BAD_SAMPLE and leaves the finger untouched. */
tendonfmu_status tendonfmu_step(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs);

/* Takes `samples` samples in one call: initialises with the first where the finger is not initialised yet.
 *   time          [samples] s, increasing
 *   inputs        arrays of [samples × m] and [samples × n]
 *   outputs       arrays of [samples × n], [samples × m], contact and others of [1] [samples], contact_terms
 *                 [samples × n × 4 × 8], fingertip_force and its std [samples × 3]; NULL arrays are not wanted
 *   done          receives the number of samples taken (may be NULL); on an error it is the row that was refused,
 *                 and the outputs of the rows before it are written */
tendonfmu_status tendonfmu_run(tendonfmu_finger* finger, size_t samples, const double* time,
                               const tendonfmu_inputs* inputs, const tendonfmu_outputs* outputs, size_t* done);

/* Takes the sample at `time` of every finger of a hand, and copies what it gives. A finger that has taken no sample
 * takes its first one. Where one sample is refused, that finger stays as it was and the others take theirs.
 *   fingers       [count], each another one
 *   inputs        [count], those of finger k
 *   outputs       [count], or NULL: not wanted; all of the same `size`; those of a finger that refuses are left alone
 *   statuses      [count] receives what tendonfmu_step() would return of each, or NULL
 * Returns TENDONFMU_OK, or the status of the first finger that refuses. */
tendonfmu_status tendonfmu_step_hand(size_t count, tendonfmu_finger* const* fingers, double time,
                                     const tendonfmu_inputs* inputs, const tendonfmu_outputs* outputs,
                                     tendonfmu_status* statuses);

/* What the caller of tendonfmu_run_guided() knows of a recording, and one more of its results. NULL arrays: learn from
 * all samples, no torque known, not wanted. */
typedef struct tendonfmu_guide {
  const unsigned char* learns; /* [samples] 1 where the bias may learn */
  const double* known_torque;  /* [samples × n] N·m, external torque as the tendons have to hold it */
  double* variance;            /* [samples × n] (N·m)², receives S of the residual; NaN until the bias has begun */
} tendonfmu_guide;

/* What a finger leaves of a recording: tendonfmu_run() with a finger that has taken no sample, in which the caller says
 * what the bias learns from. Neither contact nor a failing sensor is detected: a finger with sensor_fault is refused,
 * and the outputs of the detection say nothing. joint_torque is τ less the known torque, and so is what follows from
 * it. Where the bias may not learn it still jumps with stiction, and P grows by drift_variance. Without
 * bias.initial_torque it begins with the first sample that it may learn from; residual means nothing before the sample
 * after. */
tendonfmu_status tendonfmu_run_guided(tendonfmu_finger* finger, size_t samples, const double* time,
                                      const tendonfmu_inputs* inputs, const tendonfmu_guide* guide,
                                      const tendonfmu_outputs* outputs, size_t* done);

/* Copies the outputs of the sample last taken. */
tendonfmu_status tendonfmu_get_outputs(const tendonfmu_finger* finger, const tendonfmu_outputs* outputs);

/* Time of the sample last taken; 0 before the initialisation. */
double tendonfmu_get_time(const tendonfmu_finger* finger);

/* 1 once the first sample is taken. */
int tendonfmu_is_initialised(const tendonfmu_finger* finger);

/* Directional derivative of the outputs of the last sample by the inputs of that sample, along `direction`; all that is
 * remembered is held fixed, branch decisions are frozen. The parameters are those in force: take it before you write
 * others.
 *   direction     derivatives of the inputs: [m], [m], [n], [n]; a NULL array stands for zeros
 *   derivative    receives derivatives of the six outputs by name up to joint_speed, each [n] or NULL; all
 *                 others are left alone
 * TENDONFMU_WRONG_ORDER before the initialisation. */
tendonfmu_status tendonfmu_get_directional_derivative(tendonfmu_finger* finger, const tendonfmu_inputs* direction,
                                                      const tendonfmu_outputs* derivative);

/* --- Parameters ------------------------------------------------------------------------------------------------ */

typedef struct tendonfmu_parameter_info {
  double start;   /* value in the image */
  double minimum; /* allowed range */
  double maximum;
  int above_minimum; /* 1: the minimum itself is not allowed */
  int tunable;       /* 1: may be written between steps; 0: before tendonfmu_initialise() only */
  const char* unit;  /* static text in FMI notation: "N", "m/s", "N.m", "1", ... */
} tendonfmu_parameter_info;

/* Number of parameters p; indices run from 0 to p − 1. */
size_t tendonfmu_parameter_count(const tendonfmu_finger* finger);

/* Writes the path, such as "tendons[1].edge_friction[2].laws[1].coulomb", and a zero into path [path_size]. 80 bytes
 * are enough for every path. */
tendonfmu_status tendonfmu_get_parameter_path(const tendonfmu_finger* finger, size_t index, char* path,
                                              size_t path_size);

/* Index of a path; p when there is none or path is NULL, 0 without a finger. */
size_t tendonfmu_find_parameter(const tendonfmu_finger* finger, const char* path);

tendonfmu_status tendonfmu_get_parameter_info(const tendonfmu_finger* finger, size_t index,
                                              tendonfmu_parameter_info* info);

/* Reads `count` parameters: indices [count], values [count]. indices NULL stands for 0..count − 1. */
tendonfmu_status tendonfmu_get_parameters(const tendonfmu_finger* finger, size_t count, const size_t* indices,
                                          double* values);

/* Writes `count` parameters, all or none. Each value is checked against its range, and together they must still be a
 * finger (static >= coulomb, angles increasing, moment arms of full column rank). Takes effect with the next sample. */
tendonfmu_status tendonfmu_set_parameters(tendonfmu_finger* finger, size_t count, const size_t* indices,
                                          const double* values);

/* Takes over all parameters of another finger of the same image. Their checks and all that follows from them were done
 * when they were written into that one, so this is a copy, bounded by the number of parameters: for a control loop
 * whose parameters another thread prepares. It allocates nothing and takes no lock; `prepared` is only read, and the
 * caller sees to it that nobody writes it meanwhile. What a later sample gives is as after tendonfmu_set_parameters().
 * TENDONFMU_WRONG_ORDER where a parameter that is fixed once the first sample is taken differs. */
tendonfmu_status tendonfmu_take_parameters(tendonfmu_finger* finger, const tendonfmu_finger* prepared);

/* One parameter by its path. */
tendonfmu_status tendonfmu_get_parameter(const tendonfmu_finger* finger, const char* path, double* value);
tendonfmu_status tendonfmu_set_parameter(tendonfmu_finger* finger, const char* path, double value);

/* --- State ----------------------------------------------------------------------------------------------------- */

/* Bytes of a saved state: header, parameter values, everything that is remembered, outputs. The same for every finger
 * of one image. */
size_t tendonfmu_state_size(const tendonfmu_finger* finger);

/* Copies the whole state into bytes [size = tendonfmu_state_size()], any alignment. Little-endian, checksummed. */
tendonfmu_status tendonfmu_save_state(const tendonfmu_finger* finger, void* bytes, size_t size);

/* Takes over a saved state, in any process on any machine; what follows is then bit-identical on the same kind of
 * machine. Damaged bytes and those of another image are TENDONFMU_BAD_STATE and change nothing. */
tendonfmu_status tendonfmu_restore_state(tendonfmu_finger* finger, const void* bytes, size_t size);

/* Back to what tendonfmu_create() gave: parameters of the image, kinematics source 1, not initialised. */
tendonfmu_status tendonfmu_reset(tendonfmu_finger* finger);

/* --- Kernels --------------------------------------------------------------------------------------------------- */

/* The step exists for several instruction sets; all give the same bits. Creation takes the fastest one that the
 * processor and operating system allow. */
const char* tendonfmu_get_kernel(const tendonfmu_finger* finger); /* "plain", "sse2", "avx2" or "neon" */

/* Takes another one, "auto" for the choice above; TENDONFMU_BAD_ARGUMENT where it cannot run here. */
tendonfmu_status tendonfmu_set_kernel(tendonfmu_finger* finger, const char* name);

#ifdef __cplusplus
}
#endif

#endif
