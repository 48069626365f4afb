/* The simulated finger: rigid links moved by elastic tendons with dynamic (LuGre) friction, with sensors and truth.
 *
 *   plant = tendonfmu_plant_create(rig_json, size, ...)     the text of an expanded rig (docs/reference/rig.md)
 *   tendonfmu_plant_initialise(plant)                       settles the finger, then stands at time 0
 *   tendonfmu_plant_set_inputs(plant, &inputs)              held until they are set again
 *   tendonfmu_plant_advance(plant, t)                       integrates up to t
 *   tendonfmu_plant_get_signals(plant, &signals)            what the sensors say, and the truth, at that time
 *
 * It shares no friction code with tendonfmu.h: the model is judged against it. Conventions as in tendonfmu.h: SI units,
 * the caller owns what it passes, one thread at a time for each plant, one line of error. Not real-time: it allocates.
 */
#ifndef TENDONFMU_PLANT_H
#define TENDONFMU_PLANT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum tendonfmu_plant_status {
  TENDONFMU_PLANT_OK = 0,
  TENDONFMU_PLANT_BAD_ARGUMENT = 1, /* a null pointer, or a value that is not finite or out of range */
  TENDONFMU_PLANT_BAD_RIG = 2,      /* the rig is refused: key, value, expectation */
  TENDONFMU_PLANT_BAD_STATE = 3,    /* saved bytes that are damaged or of another rig */
  TENDONFMU_PLANT_WRONG_ORDER = 4,  /* before or after the initialisation, or time going back */
  TENDONFMU_PLANT_SOLVER = 5        /* the integrator gave up: time, cause, what to try */
} tendonfmu_plant_status;

typedef struct tendonfmu_plant tendonfmu_plant;

/* Creates a plant from the text of an expanded rig. Returns NULL when refused, with the reason in message. */
tendonfmu_plant* tendonfmu_plant_create(const char* rig_json, size_t size, char* message, size_t message_size);

/* NULL is allowed. */
void tendonfmu_plant_destroy(tendonfmu_plant* plant);

size_t tendonfmu_plant_joint_count(const tendonfmu_plant* plant);
size_t tendonfmu_plant_tendon_count(const tendonfmu_plant* plant);

/* One line about the last call that failed on this plant, "" when none has. Valid until the next call. */
const char* tendonfmu_plant_last_error(const tendonfmu_plant* plant);

/* What a plant does by itself. The values the rig gives stand until they are set; all before the initialisation only.
 */
typedef struct tendonfmu_plant_settings {
  double relative_tolerance; /* of CVODE, 1e-10..1e-2 */
  int scheduled_motion;      /* 1: the motors follow the rig's own motion, inputs are added to it; 0: inputs alone */
  int scheduled_pushes;      /* 1: the rig's own pushes act, the push of the inputs beside them */
  int sensors;               /* 1: signals pass the rig's sensors; 0: they are exact */
  uint64_t seed;             /* of the sensors' noise */
  double push_point[3];      /* m, in the frame of push_link: where the push of the inputs acts */
  int push_link;             /* 1..n */
} tendonfmu_plant_settings;

tendonfmu_plant_status tendonfmu_plant_get_settings(const tendonfmu_plant* plant, tendonfmu_plant_settings* settings);
tendonfmu_plant_status tendonfmu_plant_set_settings(tendonfmu_plant* plant, const tendonfmu_plant_settings* settings);

/* Inputs, held until set again; all 0 at first. With scheduled_motion they add to the rig's own commands. */
typedef struct tendonfmu_plant_inputs {
  const double* tendon_position_command; /* [m] m; NULL: leave as it is */
  double pretension;                     /* N, mean tendon force that the motors add beyond the rig's own */
  double push_force[3];                  /* N, base frame, acts on push_point of push_link */
} tendonfmu_plant_inputs;

tendonfmu_plant_status tendonfmu_plant_set_inputs(tendonfmu_plant* plant, const tendonfmu_plant_inputs* inputs);

/* Brings the finger to rest in its first posture, by a motion of the rig's `settle` time before 0, and stands at time
 * 0. Without scheduled_motion the first posture is the rig's initial position with the rig's pretension, to which
 * tendon_position_command then refers as an absolute motor position: see tendonfmu_plant_hold_command(). */
tendonfmu_plant_status tendonfmu_plant_initialise(tendonfmu_plant* plant);
int tendonfmu_plant_is_initialised(const tendonfmu_plant* plant);

/* Motor positions that hold the rig's initial posture with its pretension: tendon_position_command [m] at rest. */
tendonfmu_plant_status tendonfmu_plant_hold_command(const tendonfmu_plant* plant, double* command);

/* Integrates from the present time up to `time` (equal: nothing happens). A failed call leaves the plant at the time
 * it had before. */
tendonfmu_plant_status tendonfmu_plant_advance(tendonfmu_plant* plant, double time);
double tendonfmu_plant_get_time(const tendonfmu_plant* plant);

/* Signals at the present time. A NULL array is not wanted. `measured` arrays are the newest sample of the rig's sensors
 * (every 1/rate s), the rest is true. */
typedef struct tendonfmu_plant_signals {
  double* measured_tendon_force;    /* [m] N */
  double* measured_tendon_position; /* [m] m */
  double* measured_joint_position;  /* [n] rad */
  double* measured_joint_velocity;  /* [n] rad/s */
  double* measured_external_torque; /* [n] N·m */
  double* tendon_force;             /* [m] N      tension at the spring */
  double* tendon_position;          /* [m] m      motor side */
  double* joint_position;           /* [n] rad */
  double* joint_velocity;           /* [n] rad/s */
  double* joint_torque;             /* [n] N·m    of the tensions at the springs, by the true moment arms */
  double*
      friction_torque; /* [n] N·m    joint_torque − external − inertial − stop: T_eff of the paper, with the cover */
  double* external_torque; /* [n] N·m    −Jᵀ F of pushes and obstacle: load as the tendons see it */
  double* inertial_torque; /* [n] N·m    M q̈ + velocity terms + gravity */
  double* stop_torque;     /* [n] N·m    of the joint limits, as the tendons see it */
  double* contact_force;   /* [3] N      sum of all forces on the finger, base frame */
  double* contact_point;   /* [3] m      where the largest of them acts, base frame; tip when there is none */
  double* tip_position;    /* [3] m */
  double* friction_level;  /* [1]        factor on all friction: drift and heat */
  double* energy;          /* [6] J      kinetic, potential (gravity, springs, cover, stops, obstacle), work of the
                                         motors, of friction (taken out), of damping (taken out), of pushes */
  unsigned char* contact;  /* [1]        a force above the rig's contact_force */
  unsigned char* slack;    /* [m]        tendon without tension at the spring */
} tendonfmu_plant_signals;

tendonfmu_plant_status tendonfmu_plant_get_signals(const tendonfmu_plant* plant,
                                                   const tendonfmu_plant_signals* signals);

/* Advances through `samples` increasing times and writes one row of signals for each: arrays of [samples × size]. Stops
 * at the first failure; `done` receives the rows written (may be NULL). */
tendonfmu_plant_status tendonfmu_plant_run(tendonfmu_plant* plant, size_t samples, const double* time,
                                           const tendonfmu_plant_signals* signals, size_t* done);

/* State at the present time: continuous and discrete states, inputs, sensors. Two restored runs agree to the bit, with
 * the uninterrupted one within the tolerances (restoring restarts CVODE, which cannot store its history). Bytes that no
 * such plant could have saved are refused. Saving needs an initialised plant; restoring one of the same rig and
 * settings, initialised or not. */
size_t tendonfmu_plant_state_size(const tendonfmu_plant* plant);
tendonfmu_plant_status tendonfmu_plant_save_state(const tendonfmu_plant* plant, void* bytes, size_t size);
tendonfmu_plant_status tendonfmu_plant_restore_state(tendonfmu_plant* plant, const void* bytes, size_t size);

/* Back to before the initialisation, settings kept. */
tendonfmu_plant_status tendonfmu_plant_reset(tendonfmu_plant* plant);

/* Work of the integrator since the initialisation. */
typedef struct tendonfmu_plant_statistics {
  unsigned long long steps;
  unsigned long long right_hand_sides;
  unsigned long long jacobians;
  unsigned long long roots;    /* slack, stops, obstacle: switched at the root */
  unsigned long long restarts; /* of CVODE: after roots, changed inputs, restored states */
} tendonfmu_plant_statistics;
tendonfmu_plant_status tendonfmu_plant_get_statistics(const tendonfmu_plant* plant, tendonfmu_plant_statistics* found);

/* Right-hand side of the differential equations at a given state, for checks against independent implementations.
 *   state, derivative   [tendonfmu_plant_order()]: q, q̇, motor position, motor velocity, bristles, heat, motor work,
 *                       friction work, damping work, push work */
size_t tendonfmu_plant_order(const tendonfmu_plant* plant);
tendonfmu_plant_status tendonfmu_plant_derivative(const tendonfmu_plant* plant, double time, const double* state,
                                                  double* derivative);
/* The state at the present time. */
tendonfmu_plant_status tendonfmu_plant_get_continuous_state(const tendonfmu_plant* plant, double* state);

#ifdef __cplusplus
}
#endif

#endif
