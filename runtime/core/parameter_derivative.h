/* Derivative of the last sample's torques by the parameters: T_j of eq. (10) and the bias increments Δb_j of fig. 5.
 *
 * Friction sits at places: the edges and pulleys along each tendon, and two in each joint. A place has one friction
 * value F at a sample (and, where it comes to rest or begins to move, one jump b), and F depends on the four numbers of
 * one side of a law, or of two laws between two working points. So the derivative is kept as a product:
 *
 *   ∂T_j/∂θ = Σ over places  torque_factor[place][j] · ∂F/∂θ
 *   ∂Δb_j/∂θ = Σ over places  jump_factor[place][j] · ∂F/∂θ + bias_factor[place][j] · ∂b/∂θ
 *
 * The factors carry the forces along: friction at one place changes the forces behind it, hence all losses there
 * (differs from sect. V: the paper's regressors freeze f_A and f_B, which leaves out that part). Numbers of extensions
 * are not among the parameters here. */
#pragma once

#include "finger_memory.h"

enum { SIDE_STATIC, SIDE_COULOMB, SIDE_RATE, SIDE_VISCOUS };

/* Slopes of F, or of b, at a place by one side of one law. */
typedef struct law_term {
  uint32_t place;
  uint32_t side; /* parameter index of its static; coulomb, stribeck_velocity, viscous follow */
  double speed;  /* |v|; of a jump v_min */
  /* by static, coulomb, 1/vs (not vs), viscous: signed, with the working point's weight */
  double slope[LAW_SIDE_NUMBERS];
} law_term;

/* Slope of T_j by a number of a cover. */
typedef struct plain_term {
  uint32_t parameter, joint;
  double slope;
} plain_term;

/* Room for the derivative of one sample. Place i·2n + 2j is the edge of tendon i before joint j, i·2n + 2j + 1 its
 * pulley at joint j, m·2n + 2j the friction T_jv0 and m·2n + 2j + 1 the load friction T_jvf of joint j (0-based). */
typedef struct parameter_derivative {
  size_t joints, tendons, places;
  size_t plain_count;
  /* where the laws stand among the parameters */
  uint32_t *edge_side[2], *pulley_side[2], *joint_side[2], *load_side[2]; /* [record], [n × M], [N], [N]: by sign */
  /* of the last sample */
  int has_jump; /* something came to rest or began to move: only then jump_factor and bias_factor are filled */
  size_t friction_count, bias_count;
  law_term *friction, *bias;                         /* by F, by b */
  plain_term* plain;                                 /* of T alone */
  double *torque_factor, *jump_factor, *bias_factor; /* [places × n]; rows of places without a term mean nothing */
  double *moved, *jumped;                            /* [2n] F and b along the tendon being read */
  /* [elements × places] of the samples before: what an element holds, by its limit; 0 where nothing remembers */
  double* by_limit;
} parameter_derivative;

/* Bytes of memory that the derivative of this finger needs. */
size_t parameter_derivative_size(const tendonfmu_finger* finger);

/* Lays it into memory [parameter_derivative_size], aligned for doubles. */
void parameter_derivative_place(const tendonfmu_finger* finger, void* memory, parameter_derivative* derivative);

/* Fills it for the sample that the finger last took, by a step: a restored state has no scratch. */
void parameter_derivative_read(const tendonfmu_finger* finger, parameter_derivative* derivative);
