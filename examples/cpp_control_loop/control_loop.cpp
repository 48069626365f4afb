// A control loop that feels contact through the tendons.
//
//   control_loop FINGER.json RECORDING.csv [--no-wait]       at the pace of the recording, or at once
//
// Start-up reads files and may throw. The loop neither allocates nor throws, and calls the system only to wait for the
// next sample and to print.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <tendonfmu.hpp>
#include <thread>
#include <vector>

#include "recording.hpp"

namespace {

using monotonic = std::chrono::steady_clock;

tendonfmu::finger load_finger(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file.is_open() || text.empty()) {
    throw std::runtime_error(path + ": cannot read it, or it is empty");
  }
  auto finger = tendonfmu::finger::from_json(text);
  if (!finger) {
    throw std::runtime_error(path + ": " + finger.message());
  }
  return *std::move(finger);
}

struct summary {
  long samples = 0, refused = 0, contacts = 0;
  double longest_step = 0.0, latest = 0.0;  // s
};

double seconds_since(monotonic::time_point start) noexcept {
  return std::chrono::duration<double>(monotonic::now() - start).count();
}

// Says when contact begins and ends, and which joint feels it most.
void print_change(double time, bool contact, tendonfmu::span<const double> torque) noexcept {
  if (!contact) {
    std::printf("%8.3f s  free again\n", time);
    return;
  }
  std::size_t most = 0;
  for (std::size_t j = 1; j < torque.size(); ++j) {
    most = std::fabs(torque[j]) > std::fabs(torque[most]) ? j : most;
  }
  std::printf("%8.3f s  contact, compensated torque of joint %zu: %+.4f N.m\n", time, most + 1, torque[most]);
}

// `torque` [n] is room for the compensated torques.
summary control(tendonfmu::finger& finger, recording& source, bool waits, tendonfmu::span<double> torque) noexcept {
  summary found;
  unsigned char contact = 0, before = 0;
  tendonfmu::outputs wanted;
  wanted.compensated_torque = torque;
  wanted.contact = tendonfmu::one(contact);

  const auto start = monotonic::now();
  for (sample now; source.read(now);) {
    if (waits) {
      std::this_thread::sleep_until(
          start + std::chrono::duration_cast<monotonic::duration>(std::chrono::duration<double>(now.time)));
      found.latest = std::fmax(found.latest, seconds_since(start) - now.time);
    }

    const auto begin = monotonic::now();
    const tendonfmu::status taken = finger.is_initialised() ? finger.step(now.time, {now.force, now.position})
                                                            : finger.initialise(now.time, {now.force, now.position});
    found.longest_step = std::fmax(found.longest_step, seconds_since(begin));
    ++found.samples;
    if (taken != tendonfmu::status::ok || finger.get_outputs(wanted) != tendonfmu::status::ok) {
      std::printf("%8.3f s  refused: %s\n", now.time, finger.last_error());  // the finger is as it was
      ++found.refused;
      continue;
    }

    // Here your controller would use `torque` and `contact`.
    if (contact != before) {
      print_change(now.time, contact != 0, torque);
      found.contacts += contact;
      before = contact;
    }
  }
  return found;
}

}  // namespace

int main(int count, char** argument) {
  const bool waits = count == 3;
  if (!waits && !(count == 4 && std::string(argument[3]) == "--no-wait")) {
    std::fputs("usage: control_loop FINGER.json RECORDING.csv [--no-wait]\n", stderr);
    return 2;
  }
  try {
    tendonfmu::finger finger = load_finger(argument[1]);
    recording source(argument[2], finger.tendon_count());
    std::vector<double> torque(finger.joint_count());
    const summary found = control(finger, source, waits, torque);
    std::printf("%zu joints, %zu tendons, kernel %s: %ld samples, %ld refused, %ld contacts, longest step %.1f us",
                finger.joint_count(), finger.tendon_count(), finger.get_kernel(), found.samples, found.refused,
                found.contacts, 1e6 * found.longest_step);
    std::printf(waits ? ", latest sample %.2f ms late\n" : "\n", 1e3 * found.latest);
    return found.refused > 0 ? 1 : 0;
  } catch (const std::exception& caught) {
    std::fprintf(stderr, "control_loop: %s\n", caught.what());
    return 2;
  }
}
