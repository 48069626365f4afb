/* The numbers of a simulated finger, as read and checked: plain data in SI units, joints and tendons counted from 0. */
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace tendonfmu::plant {

using three = Eigen::Vector3d;

constexpr std::size_t max_joints = 16, max_tendons = 64;

/* --- Friction -------------------------------------------------------------------------------------------------- */

/* One side of a friction law, magnitudes: share of the tension (tendons), N·m or m (joints). */
struct law_side {
  double break_away = 0.0;    /* static */
  double sliding = 0.0;       /* coulomb */
  double stribeck_rate = 1.0; /* 1/stribeck_velocity, s/m or s/rad */
  double viscous = 0.0;
};

struct law {
  law_side positive, negative;
  double break_away = 0.0; /* mean of both sides */
};

/* A law by the angle of the joint before: values interpolated linearly, constant outside. One law: no angles. */
struct law_by_angle {
  std::vector<double> angles;
  std::vector<law> laws;
};

/* How far a tendon is diverted by an edge, and what that does: replaces the working points (rig key `edges`). */
struct diversion {
  enum class form { none, sine, capstan_share, capstan_exponent };
  form shape = form::none;
  double rest = 0.0, slope = 1.0, centre = 0.0;         /* θ = rest + slope (q − centre), rad */
  double normal = 1.0;                                  /* coulomb level of the law that is scaled to the diversion's */
  double coefficient = 0.0, negative_coefficient = 0.0; /* for θ >= 0 and θ < 0 */
};

/* A place where a tendon rubs. Sites of a tendon follow each other as the tendon passes them. */
struct friction_site {
  enum class place { wrist, edge, pulley };
  place where = place::edge;
  std::size_t tendon = 0;
  std::size_t first_mover = 0; /* slides by the joints first_mover .. n-1 (eq. 5) */
  bool bends = false;          /* the laws depend on the angle of angle_joint; else they are taken at angle 0 */
  std::size_t angle_joint = 0;
  law_by_angle friction;
  diversion turn;
  double inverse_length = 0.0; /* 1/presliding, 1/m */
};

/* Joint friction T_jv0, or its part T_jvf that grows with the tensions. */
struct joint_site {
  std::size_t joint = 0;
  bool by_load = false;
  law friction;
  double inverse_length = 0.0; /* 1/presliding, 1/rad */
};

enum class tension_loss { linear, capstan };
enum class pulley_torque { beyond_joint, at_joint };

struct friction_settings {
  double bristle_damping = 0.0; /* s */
  int stribeck_exponent = 1;
  tension_loss loss = tension_loss::linear;
  double preload = 0.0;                             /* N */
  double drift_amplitude = 0.0, drift_time = 300.0; /* -, s */
  double heat_coefficient = 0.0, heat_time = 100.0; /* 1/J, s */
};

/* --- Bodies and tendons ---------------------------------------------------------------------------------------- */

struct link {
  three axis = three::Zero(), offset = three::Zero(), centre_of_mass = three::Zero(), inertia = three::Zero();
  double mass = 0.0;
  double lower = 0.0, upper = 0.0, stop_stiffness = 0.0, stop_damping = 0.0;
  double cover_stiffness = 0.0, cover_rest = 0.0, cover_hardening = 0.0;
  double damping = 0.0;
};

/* r(q) = mean + slope q + eccentricity sin(q + phase) */
struct moment_arm {
  double mean = 0.0, slope = 0.0, eccentricity = 0.0, phase = 0.0;
};

struct tendon {
  double stiffness = 0.0, hardening = 0.0, damping = 0.0; /* N/m, N/m², N·s/m */
  std::vector<moment_arm> arms;                           /* [n] */
  /* number of sites passed when the tendon turns joint j, and when it loads it: [n] */
  std::vector<std::size_t> sites_before_torque, sites_before_load;
  std::vector<bool> loads; /* [n] counts in the load of joint j */
  std::size_t first_site = 0, site_count = 0;
};

struct wrist {
  double amplitude = 0.0, period = 1.0;
  std::vector<double> arms; /* [m], empty: no wrist */
};

/* --- Contact --------------------------------------------------------------------------------------------------- */

struct push {
  double start = 0.0, rise = 0.0, hold = 0.0, fall = 0.0, force = 0.0; /* s, N */
  three direction = three::Zero();                                     /* unit */
  bool in_link_frame = true;
  std::size_t link = 0;
  three point = three::Zero();
};

struct obstacle {
  bool present = false;
  three centre = three::Zero();
  double radius = 0.0, stiffness = 0.0, damping = 0.0;
  std::size_t link = 0;
  three point = three::Zero();
};

/* --- Motion, sensors, integration ------------------------------------------------------------------------------ */

/* Quintic Hermite interpolation between knots, constant outside. */
struct knots {
  std::vector<double> time, position, velocity, acceleration;
};

struct sensor {
  double noise = 0.0, resolution = 0.0, delay = 0.0, backlash = 0.0;
  std::vector<double> gain, offset; /* one per channel */
};

struct sensors {
  enum quantity { tendon_force, tendon_position, joint_position, joint_velocity, external_torque, quantities };
  double rate = 1000.0;
  sensor of[quantities];
};

struct rig {
  std::string name;
  std::uint64_t seed = 0;
  three gravity = three::Zero(), tip = three::Zero();
  std::vector<link> links;
  std::vector<double> coupling; /* [n-1] N·m/rad */
  std::vector<tendon> tendons;
  std::vector<double> null_vector; /* [m] of Rᵀ, positive, mean 1 */
  std::vector<friction_site> sites;
  std::vector<joint_site> joint_sites;
  friction_settings friction;
  plant::wrist wrist;
  plant::obstacle obstacle;
  std::vector<push> pushes;
  double contact_force = 0.05; /* N */
  double servo_frequency = 15.0, servo_damping = 1.0;
  std::vector<knots> motion; /* [n] rad */
  knots pretension;          /* N */
  double settle = 2.0;
  plant::sensors sensors;
  double relative_tolerance = 1e-6;

  std::size_t joint_count() const { return links.size(); }
  std::size_t tendon_count() const { return tendons.size(); }
  std::size_t bristle_count() const { return sites.size() + joint_sites.size(); }
  /* q, q̇, motor position and velocity, bristles, heat, four works */
  std::size_t order() const { return 2 * joint_count() + 2 * tendon_count() + bristle_count() + 5; }
};

/* From the text of an expanded rig (docs/reference/rig.md). Throws description_error: key path, value, expectation,
 * unit.
 */
rig read_rig(const char* text, std::size_t size);

}  // namespace tendonfmu::plant
