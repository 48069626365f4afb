/* The finger's differential equations. */
#pragma once

#include <vector>

#include "bristle.h"
#include "contact_force.h"
#include "rig.h"

namespace tendonfmu::plant {

/* Where things stand in the state. */
struct state_layout {
  std::size_t joints, tendons, bristles;

  explicit state_layout(const rig& rig)
      : joints(rig.joint_count()), tendons(rig.tendon_count()), bristles(rig.bristle_count()) {}
  std::size_t angle() const { return 0; }
  std::size_t speed() const { return joints; }
  std::size_t motor() const { return 2 * joints; }
  std::size_t motor_speed() const { return 2 * joints + tendons; }
  std::size_t bristle() const { return 2 * joints + 2 * tendons; }
  std::size_t heat() const { return bristle() + bristles; }
  std::size_t motor_work() const { return heat() + 1; }
  std::size_t friction_work() const { return heat() + 2; }
  std::size_t damping_work() const { return heat() + 3; }
  std::size_t push_work() const { return heat() + 4; }
  std::size_t size() const { return heat() + 5; }
};

constexpr std::size_t max_roots = max_tendons + 2 * max_joints + 1;

/* Which side of each kink the equations are on. An integrator with root finding switches it at the root, so that
 * between switches the equations are smooth there. */
struct contact_modes {
  bool slack[max_tendons] = {};
  bool below[max_joints] = {}, above[max_joints] = {}; /* beyond the lower, upper stop */
  bool touching = false;                               /* the obstacle */
};

/* What comes from outside, held between communication points. */
struct commands {
  bool scheduled_motion = true, scheduled_pushes = true;
  bool given = false;            /* a command was given: without scheduled motion it is absolute */
  double command[max_tendons]{}; /* m */
  double pretension = 0.0;       /* N, beyond the rig's own */
  free_push push;
};

/* Intermediate values of one evaluation: what outputs and Newton's matrix are made of. */
struct evaluation {
  double time = 0.0;
  contact_modes modes;
  chain_motion motion;
  double mass[max_joints * max_joints];
  double acceleration[max_joints];
  double rigid_torque[max_joints];               /* velocity terms and gravity: inverse dynamics at q̈ = 0 */
  double stop_torque[max_joints], stop_loss = 0; /* torque on the finger, N·m; W */
  contact_torque contact;
  std::vector<double> arm; /* [m × n] */
  double elongation[max_tendons], elongation_speed[max_tendons];
  double force[max_tendons], force_by_elongation[max_tendons], force_by_speed[max_tendons]; /* at the spring */
  double spring_loss = 0; /* W, of the tendons' dampers */
  double level = 1.0;
  law_columns laws;             /* of sites and joint sites */
  std::vector<double> bristles; /* [padded] */
  response_columns responses;
  std::vector<double> passed, tension;              /* [sites] e^(−λ) of a capstan; N after the site */
  std::vector<double> loss_by_share, loss_by_force; /* [sites] slopes of the tension after by λ and by the one before */
  double load[max_joints];                          /* Σ f_B of eq. (8) */
  double spring_torque[max_joints];                 /* Rᵀ f0 */
  double passed_torque[max_joints];                 /* what tendons and joint friction leave of it */
  double friction_power = 0, motor_power = 0;
  double wrist_speed = 0, wrist_power = 0; /* dα/dt; W, of what moves the wrist against friction */

  explicit evaluation(std::size_t count) : laws(count), bristles(padded(count)), responses(count) {}
};

class dynamics {
 public:
  /* The rig must outlive it. */
  explicit dynamics(const rig& rig);

  const rig& the_rig() const { return rig_; }
  const state_layout& layout() const { return layout_; }

  /* state, derivative: [layout().size()]. modes: NULL for those that the state has by itself. */
  void evaluate(double time, const double* state, const contact_modes* modes, const commands& inputs,
                double* derivative);

  const evaluation& last() const { return values_; }

  /* Where the motors shall be, [m] m. */
  void command_motors(double time, const commands& inputs, double* command) const;

  /* Whether evaluations prepare the slopes that `linearisation` takes; true at first. */
  void want_slopes(bool wanted) { slopes_ = wanted; }

  /* Modes that belong to a state by itself. */
  contact_modes modes_at(const double* state) const;

  /* Functions whose sign changes switch the modes: elongations [m], stops [2 n], obstacle [1 if present]. */
  std::size_t root_count() const;
  void roots(const double* state, double* root) const;
  /* Modes after the roots with found[k] != 0 were crossed in that direction (> 0: rising). */
  void switch_modes(const int* found, contact_modes* modes) const;
  /* Calls visit(k, mode, when_positive) for the mode of each root k, and what it is while the root is positive. */
  template <class Modes, class Visit>
  void visit_modes(Modes* modes, Visit visit) const {
    const std::size_t n = layout_.joints, m = layout_.tendons;
    for (std::size_t i = 0; i < m; ++i) {
      visit(i, modes->slack[i], false);
    }
    for (std::size_t j = 0; j < n; ++j) {
      visit(m + 2 * j, modes->below[j], true);
      visit(m + 2 * j + 1, modes->above[j], true);
    }
    if (rig_.obstacle.present) {
      visit(m + 2 * n, modes->touching, true);
    }
  }

 private:
  void move_tendons(const double* state);
  void bend_bristles(const double* state);
  void rub_tendons();
  void press_stops(const double* state);

  const rig& rig_;
  state_layout layout_;
  evaluation values_;
  bool slopes_ = true;
};

}  // namespace tendonfmu::plant
