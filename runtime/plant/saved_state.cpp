/* Saved states of the simulated finger. */
#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "plant.h"

namespace tendonfmu::plant {
namespace {

constexpr std::uint64_t state_mark = 0x33746e616c704654;  // "TFplant3"
constexpr double beyond_reason = 1e12;                    // of any number, in its unit
constexpr double largest_motion = 1e5;                    // rad, m, and their speeds: where sine_cosine() ends

std::uint64_t digest(const std::vector<double>& numbers) {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const double number : numbers) {
    std::uint64_t bits;
    std::memcpy(&bits, &number, sizeof bits);
    hash = (hash ^ bits) * 0x100000001b3;
    hash ^= hash >> 29;
  }
  return hash;
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
  sensor_bank::visit_state(plant.sensors_,
                           [&](auto* values, std::size_t count) { visit(values, count, beyond_reason); });
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

}  // namespace tendonfmu::plant
