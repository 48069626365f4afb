/* The sensitivities of one sample: ∂T_j of eq. (10) and ∂Δb_j of fig. 5 by every unknown.
 *
 * Friction sits at places: the edges and pulleys along each tendon, and two in each joint. A place has one friction
 * value F at a sample (and, where it comes to rest or begins to move, one jump b), and F depends on the four numbers of
 * one side of a law, or of two laws between two working points. So the derivative is kept as a product:
 *
 *   ∂T_j/∂z = Σ over places  torque_factor[place][j] · ∂F/∂z
 *   ∂Δb_j/∂z = Σ over places  jump_factor[place][j] · ∂F/∂z + bias_factor[place][j] · ∂b/∂z
 *
 * The factors carry the forces along: friction at one place changes the forces behind it, hence all losses there
 * (differs from sect. V: the paper's regressors freeze f_A and f_B, which leaves out that part). Numbers of extensions
 * have no derivative here. */
#pragma once

#include "recording_track.h"

namespace tendonfmu::estimation {

/* Of one law: its side for v > 0 and the one for v < 0, which are the same of a symmetric law; null without friction.
 */
using law_sides = std::array<const side_columns*, 2>;

/* A joint with a cover: columns of stiffness and rest angle, −1 where fixed. */
struct cover_columns {
  std::size_t joint;
  std::int32_t stiffness, rest_angle;
};

/* The laws by the arrays of derived_numbers that hold their numbers. */
struct placed_laws {
  /* both must outlive it */
  placed_laws(const unknown_list& unknowns, const tendonfmu_finger* finger);

  std::vector<law_sides> edge;        /* [records] as edge_law has them */
  std::vector<law_sides> pulley;      /* [n × M] */
  std::vector<law_sides> joint, load; /* [N] T_jv0, T_jvf */
  std::vector<cover_columns> covers;
};

/* One friction value, or one jump, as the unknowns move it: row j has slope[k]·factor[j] in column[k] (−1: none). */
struct sensitivity_term {
  const side_columns* side;
  std::array<double, 4> slope;     /* by coulomb, drop, rate, viscous: signed, with the working point's weight */
  std::array<double, 4> run_slope; /* the same in the order of the side's run of columns, if it has one */
  double speed; /* m/s or rad/s: ∂²/∂rate² = −speed·slope by rate, ∂²/∂rate∂drop = −speed·slope by
                   drop */
  const double* torque; /* [n] ∂T_j; nullptr: a jump's own */
  const double* jump;   /* [n] ∂Δb_j; nullptr: no jump at this sample */
};

/* A number that enters a joint's torque as it is. */
struct plain_slope {
  std::int32_t column;
  std::size_t joint;
  double slope;
};

/* Whether derivatives that are not exact will do: of friction with a memory (presliding), which is taken to hold a
 * constant share of its limit, and none by numbers of extensions. Else a finger that has them is refused. */
enum class derivatives { exact, nearly };

class sample_rows {
 public:
  /* both must outlive the rows */
  sample_rows(const unknown_list& unknowns, const tendonfmu_finger* finger, derivatives wanted = derivatives::exact);

  /* the sample that the finger last took, by a step: a restored state has no scratch */
  void read();
  bool sees_event() const;

  double torque(std::size_t joint) const { return finger_->scratch.friction[joint]; }    /* T_j of eq. (10), N·m */
  double jump(std::size_t joint) const { return finger_->scratch.bias_step[joint]; }     /* Δb_j, N·m */
  double measured(std::size_t joint) const { return finger_->remembered.torque[joint]; } /* τ_j, N·m */
  bool has_jump() const { return has_jump_; }
  const std::vector<sensitivity_term>& terms() const { return terms_; }
  const std::vector<plain_slope>& plain_terms() const { return plain_; }

  /* ∂T_j/∂z and ∂Δb_j/∂z: [joints × unknowns], rows; jump_rows may be nullptr */
  void dense(double* torque_rows, double* jump_rows) const;
  /* adds a share of them; either may be nullptr */
  void add_dense(double* torque_rows, double* jump_rows, double share) const;

 private:
  /* One place at the sample. Place i·2n + 2j is the edge of tendon i before joint j, i·2n + 2j + 1 its pulley at joint
   * j, m·2n + 2j the friction T_jv0 and m·2n + 2j + 1 the load friction T_jvf of joint j (0-based). */
  struct friction_place {
    std::size_t place, slot;
    double threshold; /* v_min */
    const double* law;
    const law_sides* sides; /* of the working point above: the next law, the next sides */
    double weight;          /* of that one; 0 without */
  };
  /* |F| of its law, or laws, at a speed, with what its slopes need. */
  struct magnitude {
    const side_columns* side[2];
    law_slopes at[2]; /* below; above, with a weight only */
    double drop[2];
    double weight, speed, value;
  };

  friction_place edge_at(std::size_t tendon, std::size_t joint) const;
  bool remembers(std::size_t slot) const;
  double grip(const double* grips, std::size_t slot) const;
  void add_side(const magnitude& m, int above, double factor, const friction_place& p, bool own_jump);
  void add_terms(const magnitude& m, double factor, const friction_place& p, bool own_jump);
  static magnitude magnitude_at(const friction_place& p, bool negative, double speed);
  magnitude present_magnitude(const friction_place& p) const;
  double slope_by_limit(const friction_place& p, double limit);
  double read_friction(const friction_place& p, double acting);
  double read_jump(const friction_place& p);
  void read_tendon(std::size_t tendon);
  void read_joint(std::size_t joint);
  void follow_forces(std::size_t tendon);
  void follow_change(std::size_t tendon, std::size_t k);

  const tendonfmu_finger* finger_;
  placed_laws laws_;
  std::size_t joints_, places_, unknowns_;
  bool has_jump_ = false; /* something came to rest or began to move: only then jump and bias factors are filled */
  std::vector<double> torque_factor_, jump_factor_, bias_factor_; /* [places × n] */
  /* along the tendon being read, place by place [2n]: F and b; the force that acts, and its slope by the force there,
   * 0 where slack replaced it by 0 */
  std::vector<double> moved_, jumped_, acting_, by_force_;
  /* [elements × places] of the samples before: what an element holds, by its limit; 0 where nothing remembers */
  std::vector<double> by_limit_;
  std::vector<sensitivity_term> terms_;
  std::vector<plain_slope> plain_;
};

}  // namespace tendonfmu::estimation
