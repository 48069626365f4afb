/* The simulated finger as a whole: equations, integrator, sensors, and what remembers them. */
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics.h"
#include "integrator.h"
#include "sensor_bank.h"
#include "tendonfmu_plant.h"

namespace tendonfmu::plant {

constexpr double same_time = 1e-9;     // s: a sample this little beyond a communication point is taken at it
constexpr double longest_time = 1e9;   // s
constexpr double largest_input = 1e6;  // m, N: beyond it only a mistake

/* A call that cannot be answered; `status` says which kind. */
struct refusal : std::runtime_error {
  tendonfmu_plant_status status;
  refusal(tendonfmu_plant_status kind, const std::string& line) : std::runtime_error(line), status(kind) {}
};

class plant {
 public:
  /* identity: of the rig, for saved states. */
  plant(rig numbers, std::uint64_t identity);
  plant(const plant&) = delete;
  plant& operator=(const plant&) = delete;

  const rig& the_rig() const { return rig_; }
  const tendonfmu_plant_settings& settings() const { return settings_; }
  void set_settings(const tendonfmu_plant_settings& settings);
  void set_inputs(const tendonfmu_plant_inputs& inputs);

  void initialise();
  void reset();
  bool initialised() const { return initialised_; }
  void advance(double time);
  double time() const { return now_.time; }
  void write_signals(const tendonfmu_plant_signals& signals, std::size_t row) const;
  statistics work() const { return integrator_ ? integrator_->work() : statistics(); }

  std::size_t state_bytes() const;
  void save(void* bytes, std::size_t size) const;
  void restore(const void* bytes, std::size_t size);

  const std::vector<double>& continuous_state() const { return now_.state; }
  void derivative(double time, const double* state, double* derivative) const;

 private:
  void need_initialised() const;
  void make_integrator();
  void evaluate() const;
  void sample();
  void move_on(double until);
  template <class Plant, class Visit>
  static void visit_state(Plant& plant, Visit visit);
  std::vector<double> state_numbers() const;
  bool state_is_sound(const std::vector<double>& numbers) const;
  void take_numbers(const std::vector<double>& numbers);

  rig rig_;
  mutable dynamics equations_;
  std::unique_ptr<integrator> integrator_;
  sensor_bank sensors_;
  std::uint64_t identity_;
  tendonfmu_plant_settings settings_;
  commands inputs_;
  moment now_;
  mutable bool evaluated_ = false;      /* equations_.last() is that of now_ */
  mutable std::vector<double> scratch_; /* derivative that nobody asked for */
  double samples_ = 0.0;                /* taken by the sensors */
  bool initialised_ = false;
};

}  // namespace tendonfmu::plant
