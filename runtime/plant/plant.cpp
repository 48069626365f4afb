#include "plant.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "bytes.h"
#include "motion.h"

namespace tendonfmu::plant {
namespace {

void need(bool good, const char* line) {
  if (!good) {
    throw refusal(TENDONFMU_PLANT_BAD_ARGUMENT, line);
  }
}

tendonfmu_plant_settings settings_of(const rig& rig) {
  tendonfmu_plant_settings settings = {};
  settings.relative_tolerance = rig.relative_tolerance;
  settings.scheduled_motion = settings.scheduled_pushes = settings.sensors = 1;
  settings.seed = rig.seed;
  std::copy(rig.tip.data(), rig.tip.data() + 3, settings.push_point);
  settings.push_link = static_cast<int>(rig.joint_count());
  return settings;
}

}  // namespace

plant::plant(rig numbers, std::uint64_t identity)
    : rig_(std::move(numbers)), equations_(rig_), sensors_(rig_), identity_(identity), settings_(settings_of(rig_)) {
  scratch_.resize(rig_.order());
  reset();
}

void plant::set_settings(const tendonfmu_plant_settings& settings) {
  if (initialised_) {
    throw refusal(TENDONFMU_PLANT_WRONG_ORDER, "settings: expected before the initialisation only");
  }
  const auto within = [](double x, double low, double high) { return x >= low && x <= high; };
  need(within(settings.relative_tolerance, 1e-10, 1e-2), "relative_tolerance: expected a number from 1e-10 to 1e-2");
  need(settings.push_link >= 1 && settings.push_link <= static_cast<int>(rig_.joint_count()),
       "push_link: expected the number of a link");
  for (const double x : settings.push_point) {
    need(within(x, -10.0, 10.0), "push_point: expected numbers from -10 to 10 m");
  }
  settings_ = settings;
  integrator_.reset();
}

void plant::set_inputs(const tendonfmu_plant_inputs& inputs) {
  const auto sane = [](double x) { return std::fabs(x) <= largest_input; };
  const std::size_t m = rig_.tendon_count();
  if (inputs.tendon_position_command) {
    for (std::size_t i = 0; i < m; ++i) {
      need(sane(inputs.tendon_position_command[i]), "tendon_position_command: expected finite numbers within 1e6 m");
    }
  }
  need(sane(inputs.pretension), "pretension: expected a finite number within 1e6 N");
  for (const double x : inputs.push_force) {
    need(sane(x), "push_force: expected finite numbers within 1e6 N");
  }

  commands next = inputs_;
  if (inputs.tendon_position_command) {
    next.given = true;
    std::copy(inputs.tendon_position_command, inputs.tendon_position_command + m, next.command);
  }
  next.pretension = inputs.pretension;
  std::copy(inputs.push_force, inputs.push_force + 3, next.push.force.data());
  const bool changed = next.given != inputs_.given || !std::equal(next.command, next.command + m, inputs_.command) ||
                       next.pretension != inputs_.pretension || next.push.force != inputs_.push.force;
  inputs_ = next;
  if (changed) {
    evaluated_ = false;
  }
  if (changed && integrator_) {
    integrator_->change_inputs();
  }
}

void plant::make_integrator() {
  if (integrator_) {
    return;
  }
  integrator_ = std::make_unique<integrator>(&equations_, settings_.relative_tolerance);
  inputs_.scheduled_motion = settings_.scheduled_motion != 0;
  inputs_.scheduled_pushes = settings_.scheduled_pushes != 0;
  inputs_.push.link = static_cast<std::size_t>(settings_.push_link) - 1;
  std::copy(settings_.push_point, settings_.push_point + 3, inputs_.push.point.data());
}

void plant::reset() {
  evaluated_ = false;
  initialised_ = false;
  integrator_.reset();
  inputs_ = {};
  sensors_.clear();
  samples_ = 0.0;
  now_.time = 0.0;
  now_.state.assign(rig_.order(), 0.0);
  now_.modes = {};
}

void plant::initialise() {
  if (initialised_) {
    throw refusal(TENDONFMU_PLANT_WRONG_ORDER, "initialise: expected once only");
  }
  make_integrator();
  const state_layout& at = equations_.layout();
  evaluated_ = false;
  moment start;
  start.time = -rig_.settle;
  start.state.assign(at.size(), 0.0);
  desired_angles(rig_, start.time, start.state.data());
  equations_.command_motors(start.time, inputs_, start.state.data() + at.motor());
  start.modes = equations_.modes_at(start.state.data());
  integrator_->forget();
  if (rig_.settle > 0.0) {
    integrator_->advance(inputs_, 0.0, 0.0, &start);
  }
  start.time = 0.0;
  std::fill(start.state.begin() + static_cast<std::ptrdiff_t>(at.heat()), start.state.end(), 0.0);
  integrator_->forget();
  integrator_->clear_work();
  now_ = start;
  initialised_ = true;
  if (settings_.sensors) {
    sample();
  }
}

void plant::need_initialised() const {
  if (!initialised_) {
    throw refusal(TENDONFMU_PLANT_WRONG_ORDER, "expected after the initialisation only");
  }
}

/* Through every sample of the sensors on the way. */
void plant::move_on(double until) {
  evaluated_ = false;
  while (settings_.sensors) {
    const double next = samples_ / rig_.sensors.rate;
    if (next > until + same_time) {
      break;
    }
    evaluated_ = false;
    integrator_->advance(inputs_, std::min(next, until), until, &now_);
    sample();
  }
  if (now_.time < until) {
    evaluated_ = false;
  }
  integrator_->advance(inputs_, until, until, &now_);
}

void plant::advance(double until) {
  need_initialised();
  need(std::isfinite(until) && until < longest_time, "time: expected a finite number of seconds below 1e9");
  if (until < now_.time) {
    throw refusal(TENDONFMU_PLANT_WRONG_ORDER, "time: expected not before the time of the simulation");
  }
  if (until == now_.time) {
    return;
  }
  const std::vector<double> before = state_numbers();
  try {
    move_on(until);
  } catch (...) {
    take_numbers(before);
    throw;
  }
}

// --- saved states ----------------------------------------------------------------------------------------

namespace {

constexpr std::uint64_t state_mark = 0x34746e616c704654;  // "TFplant4"
constexpr double beyond_reason = 1e12;                    // of any number, in its unit
constexpr double largest_motion = 1e5;                    // rad, m, and their speeds: where sine_cosine() ends

std::uint64_t digest(const std::vector<double>& numbers) {
  return hash_bytes(numbers.data(), sizeof(double) * numbers.size(), 0);
}

/* Before the numbers. Settings are compared: a state continues only as it began. */
struct state_header {
  std::uint64_t mark, identity, settings, count, digest;
};

std::uint64_t digest_of(const tendonfmu_plant_settings& s) {
  return digest({s.relative_tolerance, static_cast<double>(s.scheduled_motion), static_cast<double>(s.scheduled_pushes),
                 static_cast<double>(s.sensors), static_cast<double>(s.seed >> 32),
                 static_cast<double>(s.seed & 0xffffffffu), s.push_point[0], s.push_point[1], s.push_point[2],
                 static_cast<double>(s.push_link)});
}

}  // namespace

/* Everything that is remembered: arrays of numbers and of flags, in one order, with the largest that a number may be.
 */
template <class Plant, class Visit>
void plant::visit_state(Plant& plant, Visit visit) {
  const std::size_t n = plant.rig_.joint_count(), m = plant.rig_.tendon_count();
  const std::size_t motions = plant.equations_.layout().heat();
  visit(&plant.now_.time, 1, longest_time);
  visit(&plant.samples_, 1, beyond_reason);
  visit(&plant.inputs_.given, 1, 1.0);
  visit(&plant.inputs_.pretension, 1, largest_input);
  visit(plant.inputs_.command, m, largest_input);
  visit(plant.inputs_.push.force.data(), 3, largest_input);
  visit(plant.now_.modes.slack, m, 1.0);
  visit(plant.now_.modes.below, n, 1.0);
  visit(plant.now_.modes.above, n, 1.0);
  visit(&plant.now_.modes.touching, 1, 1.0);
  visit(plant.now_.state.data(), motions, largest_motion);
  visit(plant.now_.state.data() + motions, plant.now_.state.size() - motions, beyond_reason);
  sensor_bank::visit_state(plant.sensors_, [&](auto& values) { visit(values.data(), values.size(), beyond_reason); });
}

/* As numbers of a length that the rig fixes. */
std::vector<double> plant::state_numbers() const {
  std::vector<double> numbers;
  visit_state(*this, [&](const auto* values, std::size_t count, double) {
    numbers.insert(numbers.end(), values, values + count);
  });
  return numbers;
}

/* Whether a plant of this rig and these settings could have saved them. */
bool plant::state_is_sound(const std::vector<double>& numbers) const {
  bool sound = true;
  const double* next = numbers.data();
  visit_state(*this, [&](const auto* values, std::size_t count, double most) {
    const bool flags = std::is_same_v<decltype(values), const bool*>;
    sound = sound && std::all_of(next, next + count,
                                 [&](double x) { return flags ? x == 0.0 || x == 1.0 : std::fabs(x) <= most; });
    next += count;
  });
  const double time = numbers[0], samples = numbers[1], rate = rig_.sensors.rate;
  // as many samples as move_on() takes up to that time
  const bool taken = settings_.sensors ? samples > 0.0 && (samples - 1.0) / rate <= time + same_time &&
                                             samples / rate > time + same_time && samples == std::floor(samples)
                                       : samples == 0.0;
  return sound && taken && time >= 0.0;
}

void plant::take_numbers(const std::vector<double>& numbers) {
  evaluated_ = false;
  const double* next = numbers.data();
  visit_state(*this, [&](auto* values, std::size_t count, double) {
    std::transform(next, next + count, values,
                   [](double x) { return static_cast<std::decay_t<decltype(*values)>>(x); });
    next += count;
  });
  integrator_->forget();
}

std::size_t plant::state_bytes() const {
  return sizeof(state_header) + sizeof(double) * state_numbers().size();
}

void plant::save(void* bytes, std::size_t size) const {
  need_initialised();
  const std::vector<double> numbers = state_numbers();
  const state_header header = {state_mark, identity_, digest_of(settings_), numbers.size(), digest(numbers)};
  if (size != sizeof header + sizeof(double) * numbers.size()) {
    throw refusal(TENDONFMU_PLANT_BAD_ARGUMENT, "state: expected as many bytes as a state has");
  }
  std::memcpy(bytes, &header, sizeof header);
  std::memcpy(static_cast<char*>(bytes) + sizeof header, numbers.data(), sizeof(double) * numbers.size());
}

void plant::restore(const void* bytes, std::size_t size) {
  const auto bad = [](const char* line) { throw refusal(TENDONFMU_PLANT_BAD_STATE, line); };
  std::vector<double> numbers = state_numbers();
  state_header header;
  if (size != sizeof header + sizeof(double) * numbers.size()) {
    bad("state: of another size");
  }
  std::memcpy(&header, bytes, sizeof header);
  if (header.mark != state_mark) {
    bad("state: not that of a simulated finger");
  }
  if (header.identity != identity_) {
    bad("state: of another rig");
  }
  if (header.settings != digest_of(settings_)) {
    bad("state: taken with other settings");
  }
  std::memcpy(numbers.data(), static_cast<const char*>(bytes) + sizeof header, sizeof(double) * numbers.size());
  if (header.count != numbers.size() || header.digest != digest(numbers)) {
    bad("state: damaged");
  }

  if (!state_is_sound(numbers)) {
    bad("state: a number is out of its range");
  }
  make_integrator();
  take_numbers(numbers);
  initialised_ = true;
}

// --- signals ---------------------------------------------------------------------------------------------

/* Once for each moment: what the sensors have looked at, the signals show. */
void plant::evaluate() const {
  if (evaluated_) {
    return;
  }
  equations_.want_slopes(false);
  equations_.evaluate(now_.time, now_.state.data(), &now_.modes, inputs_, scratch_.data());
  evaluated_ = true;
}

void plant::sample() {
  evaluate();
  const evaluation& e = equations_.last();
  const state_layout& at = equations_.layout();
  const double* state = now_.state.data();
  double external[max_joints];
  std::transform(e.contact.torque, e.contact.torque + at.joints, external, [](double x) { return -x; });
  sensors_.sample(static_cast<std::uint64_t>(samples_), settings_.seed,
                  {e.force, state + at.motor(), state + at.angle(), state + at.speed(), external});
  samples_ += 1.0;
}

namespace {

double potential_energy(const rig& rig, const evaluation& e, const double* angle, const contact_modes& modes) {
  double energy = gravity_energy(rig, e.motion);
  for (std::size_t i = 0; i < rig.tendon_count(); ++i) {
    const double x = e.elongation[i];
    if (!modes.slack[i]) {
      energy += x * x * (0.5 * rig.tendons[i].stiffness + rig.tendons[i].hardening * x / 3.0);
    }
  }
  const std::size_t n = rig.joint_count();
  for (std::size_t j = 0; j < n; ++j) {
    const link& link = rig.links[j];
    const double bent = angle[j] - link.cover_rest;
    energy += bent * bent * (0.5 * link.cover_stiffness + 0.25 * link.cover_hardening * bent * bent);
    const double beyond = modes.below[j] ? link.lower - angle[j] : modes.above[j] ? angle[j] - link.upper : 0.0;
    energy += 0.5 * link.stop_stiffness * beyond * beyond;
    if (j + 1 < n) {
      const double apart = bent - (angle[j + 1] - rig.links[j + 1].cover_rest);
      energy += 0.5 * rig.coupling[j] * apart * apart;
    }
  }
  if (modes.touching) {
    const double depth = penetrate(rig.obstacle, e.motion).depth;
    energy += 0.5 * rig.obstacle.stiffness * depth * depth;
  }
  return energy;
}

void put(double* array, std::size_t row, const double* values, std::size_t count) {
  if (array) {
    std::copy(values, values + count, array + row * count);
  }
}

}  // namespace

void plant::write_signals(const tendonfmu_plant_signals& s, std::size_t row) const {
  need_initialised();
  evaluate();
  const evaluation& e = equations_.last();
  const state_layout& at = equations_.layout();
  const std::size_t n = at.joints, m = at.tendons;
  const double* state = now_.state.data();

  // torques as the tendons see them
  double external[max_joints], stop[max_joints], inertial[max_joints], friction[max_joints];
  for (std::size_t j = 0; j < n; ++j) {
    external[j] = -e.contact.torque[j];
    stop[j] = -e.stop_torque[j];
    inertial[j] = e.rigid_torque[j];
    for (std::size_t k = 0; k < n; ++k) {
      inertial[j] += e.mass[j * n + k] * e.acceleration[k];
    }
    friction[j] = e.spring_torque[j] - external[j] - stop[j] - inertial[j];
  }
  put(s.tendon_force, row, e.force, m);
  put(s.tendon_position, row, state + at.motor(), m);
  put(s.joint_position, row, state + at.angle(), n);
  put(s.joint_velocity, row, state + at.speed(), n);
  put(s.joint_torque, row, e.spring_torque, n);
  put(s.friction_torque, row, friction, n);
  put(s.external_torque, row, external, n);
  put(s.inertial_torque, row, inertial, n);
  put(s.stop_torque, row, stop, n);

  // what the sensors show; without them the truth
  const readings exact = {e.force, state + at.motor(), state + at.angle(), state + at.speed(), external};
  const readings shown = settings_.sensors ? sensors_.newest() : exact;
  put(s.measured_tendon_force, row, shown[sensors::tendon_force], m);
  put(s.measured_tendon_position, row, shown[sensors::tendon_position], m);
  put(s.measured_joint_position, row, shown[sensors::joint_position], n);
  put(s.measured_joint_velocity, row, shown[sensors::joint_velocity], n);
  put(s.measured_external_torque, row, shown[sensors::external_torque], n);

  const three tip = move_point(e.motion.links[n - 1], rig_.tip).place;
  put(s.contact_force, row, e.contact.force.data(), 3);
  put(s.contact_point, row, (e.contact.largest > 0.0 ? e.contact.place : tip).data(), 3);
  put(s.tip_position, row, tip.data(), 3);
  put(s.friction_level, row, &e.level, 1);
  const double energy[6] = {kinetic_energy(rig_, e.motion), potential_energy(rig_, e, state, now_.modes),
                            state[at.motor_work()],         state[at.friction_work()],
                            state[at.damping_work()],       state[at.push_work()]};
  put(s.energy, row, energy, 6);
  if (s.contact) {
    s.contact[row] = e.contact.largest > rig_.contact_force;
  }
  if (s.slack) {
    std::copy(now_.modes.slack, now_.modes.slack + m, s.slack + row * m);
  }
}

// --- for checks ------------------------------------------------------------------------------------------

void plant::derivative(double time, const double* state, double* result) const {
  commands inputs = inputs_;
  inputs.scheduled_motion = settings_.scheduled_motion != 0;
  inputs.scheduled_pushes = settings_.scheduled_pushes != 0;
  // laws and motions are looked up by them: what is no number has no place there
  need(std::isfinite(time), "time: expected a finite number");
  need(std::all_of(state, state + rig_.order(), [](double x) { return std::isfinite(x); }),
       "state: expected finite numbers");
  evaluated_ = false;
  equations_.want_slopes(false);
  equations_.evaluate(time, state, nullptr, inputs, result);
}

}  // namespace tendonfmu::plant
