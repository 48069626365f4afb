/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#ifndef TENDONFMU_OUTPUTS_H
#define TENDONFMU_OUTPUTS_H

#include <stddef.h>

/* Outputs of one sample, or of many, of a finger of n joints and m tendons. A NULL array is not wanted. Flags are 0 or 1.
 * Begin with = {0} and set what is wanted by name. Later versions add arrays at the end. Where the library may be of
 * another version than this header, set size too: then it gives the arrays that both know. */
typedef struct tendonfmu_outputs {
  /* sizeof(tendonfmu_outputs) of the program; 0: without the arrays that versions after 0.2 add */
  size_t size;
  /* [n] N·m: Estimate of the external torque at joint i as the tendons have to hold it: minus the torque on the finger */
  double* compensated_torque;
  /* [n] N·m: Torque of the tendons at joint i, the transposed moment arms times the tendon forces */
  double* joint_torque;
  /* [n] N·m: Modelled effective friction torque at joint i, bias included */
  double* friction_torque;
  /* [n] N·m: Effective bias at joint i: friction torque that the model alone does not explain */
  double* bias_torque;
  /* [n] rad: Angle of joint i that the model uses */
  double* joint_angle;
  /* [n] rad/s: Velocity of joint i that the model uses */
  double* joint_speed;
  /* [n]: True when the compensated torque of joint i exceeds its threshold */
  unsigned char* joint_contact;
  /* [1]: True when any joint is in contact */
  unsigned char* contact;
  /* [m]: True when a modelled force of tendon i came out negative */
  unsigned char* slack;
  /* [n] N·m: Standard deviation of the compensated torque of joint i as an estimate of the external torque */
  double* compensated_torque_std;
  /* [3] N: Force on the fingertip from outside that explains the compensated torques best, base frame, axis i; 0 along directions that they do not tell; of fingers with links, else 0; computed when one of them is asked for */
  double* fingertip_force;
  /* [3] N: Standard deviation of the force at the tip, base frame, axis i, of the directions that the torques tell; 0 where their own is not known; of fingers with links, else 0; computed when one of them is asked for */
  double* fingertip_force_std;
  /* [1]: True when the torques tell all three directions of the force at the tip; of fingers with links, else 0; computed when one of them is asked for */
  unsigned char* fingertip_force_observable;
  /* [1]: Squared misfit of the compensated torques to one force at the tip, per degree of freedom: about 1 where there is one; 0 where nothing can contradict; of fingers with links, else 0; computed when one of them is asked for */
  double* fingertip_force_misfit;
  /* [1]: Contact is on this link, counted from 1, or beyond it; 0 no contact, -1 contact of which the torques do not tell the link; of fingers with links, else 0; computed when one of them is asked for */
  int* contact_link;
  /* [m]: True when the force or the position of tendon i contradicts its spring: a sensor fails; of fingers with sensor_fault, else 0 */
  unsigned char* sensor_fault;
  /* [1]: False while a failing sensor keeps contact at some joint from being seen; of fingers with sensor_fault, else 0 */
  unsigned char* contact_observable;
  /* [n] N·m: Torque of the tendons at joint i less the modelled friction, before the bias is updated */
  double* residual;
  /* [n]: How near joint i is to contact: what changes there over its bound; contact begins above 1 */
  double* contact_level;
  /* [n × 4 × 8] N·m: What the bounds of joint i are learned from, by band: change, that of it which counts, 1, and five torques in the order of contact.bands; of fingers with contact.bands, else 0 */
  double* contact_terms;
} tendonfmu_outputs;

#endif
