/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#pragma once

#include "tendonfmu.h"
#include "variables.h"

/* Inputs and outputs of a finger (tendonfmu.h) as they lie in the block of variables. */

static inline tendonfmu_inputs variables_inputs(const variables* v) {
  return (tendonfmu_inputs){
    .tendon_force = v->number[GROUP_TENDON_FORCE],
    .tendon_position = v->number[GROUP_TENDON_POSITION],
    .joint_position = v->number[GROUP_JOINT_POSITION],
    .joint_velocity = v->number[GROUP_JOINT_VELOCITY],
  };
}

static inline tendonfmu_outputs variables_outputs(const variables* v) {
  return (tendonfmu_outputs){
    .compensated_torque = v->number[GROUP_COMPENSATED_TORQUE],
    .joint_torque = v->number[GROUP_JOINT_TORQUE],
    .friction_torque = v->number[GROUP_FRICTION_TORQUE],
    .bias_torque = v->number[GROUP_BIAS_TORQUE],
    .joint_angle = v->number[GROUP_JOINT_ANGLE],
    .joint_speed = v->number[GROUP_JOINT_SPEED],
    .joint_contact = v->flag[GROUP_JOINT_CONTACT],
    .contact = v->flag[GROUP_CONTACT],
    .slack = v->flag[GROUP_SLACK],
    .compensated_torque_std = v->number[GROUP_COMPENSATED_TORQUE_STD],
    .fingertip_force = v->number[GROUP_FINGERTIP_FORCE],
    .fingertip_force_std = v->number[GROUP_FINGERTIP_FORCE_STD],
    .fingertip_force_observable = v->flag[GROUP_FINGERTIP_FORCE_OBSERVABLE],
    .fingertip_force_misfit = v->number[GROUP_FINGERTIP_FORCE_MISFIT],
    .sensor_fault = v->flag[GROUP_SENSOR_FAULT],
    .contact_observable = v->flag[GROUP_CONTACT_OBSERVABLE],
    .residual = v->number[GROUP_RESIDUAL],
    .contact_level = v->number[GROUP_CONTACT_LEVEL],
  };
}

/* Copies the outputs of the last sample. The block of variables holds numbers of one type, so Integer ones go through a variable of their own. */
static inline void variables_fetch_outputs(variables* v, const tendonfmu_finger* finger) {
  tendonfmu_outputs outputs = variables_outputs(v);
  int contact_link = 0;
  outputs.contact_link = v->number[GROUP_CONTACT_LINK] ? &contact_link : NULL;
  tendonfmu_get_outputs(finger, &outputs);
  if (outputs.contact_link) {
    *v->number[GROUP_CONTACT_LINK] = contact_link;
  }
}
