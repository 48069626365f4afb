#include "contact_force.h"

#include <algorithm>

namespace tendonfmu::plant {

double push_strength(const push& push, double time) {
  const double since = time - push.start;
  const double left = push.rise + push.hold + push.fall - since;
  if (since <= 0.0 || left <= 0.0) {
    return 0.0;
  }
  if (since < push.rise) {
    return 0.5 * push.force * (1.0 - cosine(pi * since / push.rise));
  }
  if (left < push.fall) {
    return 0.5 * push.force * (1.0 - cosine(pi * left / push.fall));
  }
  return push.force;
}

std::vector<double> push_times(const rig& rig) {
  std::vector<double> times;
  for (const push& push : rig.pushes) {
    double time = push.start;
    times.push_back(time);
    for (const double part : {push.rise, push.hold, push.fall}) {
      times.push_back(time += part);
    }
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

}  // namespace tendonfmu::plant
