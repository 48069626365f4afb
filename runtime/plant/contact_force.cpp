#include "contact_force.h"

namespace tendonfmu::plant {

double push_strength(const push& push, double time) {
  const double since = time - push.start;
  const double left = push.rise + push.hold + push.fall - since;
  if (since <= 0.0 || left <= 0.0) return 0.0;
  if (since < push.rise) return 0.5 * push.force * (1.0 - cosine(pi * since / push.rise));
  if (left < push.fall) return 0.5 * push.force * (1.0 - cosine(pi * left / push.fall));
  return push.force;
}

}  // namespace tendonfmu::plant
