/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#ifndef TENDONFMU_OUTPUTS_HPP
#define TENDONFMU_OUTPUTS_HPP

#include "tendonfmu_outputs.h"
#include "tendonfmu_span.hpp"

namespace tendonfmu {

/* Where the outputs go: arrays of the caller, as tendonfmu_outputs.h explains them. An empty one is not wanted. */
struct outputs {
  span<double> compensated_torque = {};
  span<double> joint_torque = {};
  span<double> friction_torque = {};
  span<double> bias_torque = {};
  span<double> joint_angle = {};
  span<double> joint_speed = {};
  span<unsigned char> joint_contact = {};
  span<unsigned char> contact = {};
  span<unsigned char> slack = {};
  span<double> compensated_torque_std = {};
  span<double> fingertip_force = {};
  span<double> fingertip_force_std = {};
  span<unsigned char> fingertip_force_observable = {};
  span<double> fingertip_force_misfit = {};
  span<int> contact_link = {};
  span<unsigned char> sensor_fault = {};
  span<unsigned char> contact_observable = {};
  span<double> residual = {};
  span<double> contact_level = {};
  span<double> contact_terms = {};
};

namespace detail {

// Calls visit(name, array, pointer of `c`, numbers of a sample) for each of them.
template <typename Visit>
void for_each_output(const outputs& arrays, tendonfmu_outputs& c, std::size_t joints, std::size_t tendons,
                     Visit visit) noexcept {
  visit("compensated_torque", arrays.compensated_torque, c.compensated_torque, joints);
  visit("joint_torque", arrays.joint_torque, c.joint_torque, joints);
  visit("friction_torque", arrays.friction_torque, c.friction_torque, joints);
  visit("bias_torque", arrays.bias_torque, c.bias_torque, joints);
  visit("joint_angle", arrays.joint_angle, c.joint_angle, joints);
  visit("joint_speed", arrays.joint_speed, c.joint_speed, joints);
  visit("joint_contact", arrays.joint_contact, c.joint_contact, joints);
  visit("contact", arrays.contact, c.contact, 1);
  visit("slack", arrays.slack, c.slack, tendons);
  visit("compensated_torque_std", arrays.compensated_torque_std, c.compensated_torque_std, joints);
  visit("fingertip_force", arrays.fingertip_force, c.fingertip_force, 3);
  visit("fingertip_force_std", arrays.fingertip_force_std, c.fingertip_force_std, 3);
  visit("fingertip_force_observable", arrays.fingertip_force_observable, c.fingertip_force_observable, 1);
  visit("fingertip_force_misfit", arrays.fingertip_force_misfit, c.fingertip_force_misfit, 1);
  visit("contact_link", arrays.contact_link, c.contact_link, 1);
  visit("sensor_fault", arrays.sensor_fault, c.sensor_fault, tendons);
  visit("contact_observable", arrays.contact_observable, c.contact_observable, 1);
  visit("residual", arrays.residual, c.residual, joints);
  visit("contact_level", arrays.contact_level, c.contact_level, joints);
  visit("contact_terms", arrays.contact_terms, c.contact_terms, joints * 32);
}

}  // namespace detail
}  // namespace tendonfmu

#endif
