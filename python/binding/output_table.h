/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#pragma once

#include <cstddef>

#include "tendonfmu.h"

enum class output_type { number, flag, count };
enum class output_size { scalar, joints, tendons, vector, terms }; /* terms: joints × 4 × 8 */
enum class output_need { nothing, terms, links, sensor_fault };

struct output_row {
  const char* name;
  std::size_t offset; /* of its pointer in tendonfmu_outputs */
  output_type type;
  output_size size;
  output_need need;
  bool has_derivative; /* tendonfmu_get_directional_derivative() gives it */
};

constexpr output_row output_table[] = {
    {"compensated_torque", offsetof(tendonfmu_outputs, compensated_torque), output_type::number, output_size::joints, output_need::nothing, true},
    {"joint_torque", offsetof(tendonfmu_outputs, joint_torque), output_type::number, output_size::joints, output_need::nothing, true},
    {"friction_torque", offsetof(tendonfmu_outputs, friction_torque), output_type::number, output_size::joints, output_need::nothing, true},
    {"bias_torque", offsetof(tendonfmu_outputs, bias_torque), output_type::number, output_size::joints, output_need::nothing, true},
    {"joint_angle", offsetof(tendonfmu_outputs, joint_angle), output_type::number, output_size::joints, output_need::nothing, true},
    {"joint_speed", offsetof(tendonfmu_outputs, joint_speed), output_type::number, output_size::joints, output_need::nothing, true},
    {"joint_contact", offsetof(tendonfmu_outputs, joint_contact), output_type::flag, output_size::joints, output_need::nothing, false},
    {"contact", offsetof(tendonfmu_outputs, contact), output_type::flag, output_size::scalar, output_need::nothing, false},
    {"slack", offsetof(tendonfmu_outputs, slack), output_type::flag, output_size::tendons, output_need::nothing, false},
    {"compensated_torque_std", offsetof(tendonfmu_outputs, compensated_torque_std), output_type::number, output_size::joints, output_need::nothing, false},
    {"fingertip_force", offsetof(tendonfmu_outputs, fingertip_force), output_type::number, output_size::vector, output_need::links, false},
    {"fingertip_force_std", offsetof(tendonfmu_outputs, fingertip_force_std), output_type::number, output_size::vector, output_need::links, false},
    {"fingertip_force_observable", offsetof(tendonfmu_outputs, fingertip_force_observable), output_type::flag, output_size::scalar, output_need::links, false},
    {"fingertip_force_misfit", offsetof(tendonfmu_outputs, fingertip_force_misfit), output_type::number, output_size::scalar, output_need::links, false},
    {"contact_link", offsetof(tendonfmu_outputs, contact_link), output_type::count, output_size::scalar, output_need::links, false},
    {"sensor_fault", offsetof(tendonfmu_outputs, sensor_fault), output_type::flag, output_size::tendons, output_need::sensor_fault, false},
    {"contact_observable", offsetof(tendonfmu_outputs, contact_observable), output_type::flag, output_size::scalar, output_need::sensor_fault, false},
    {"residual", offsetof(tendonfmu_outputs, residual), output_type::number, output_size::joints, output_need::nothing, false},
    {"contact_level", offsetof(tendonfmu_outputs, contact_level), output_type::number, output_size::joints, output_need::nothing, false},
    {"contact_terms", offsetof(tendonfmu_outputs, contact_terms), output_type::number, output_size::terms, output_need::terms, false},
};
