#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>

/* A progressive spring: |f| = k e + hardening e². The position is corrected so that subtracting f/k leaves x0 − e. */

enum { BY_FORCE, MEMORY_COUNT }; /* of the correction, m/N */

static void signal(effect_place place, const double* values, effect_signals* signals, const double* before,
                   double* after) {
  (void)before;
  if (signals->source != 1) {
    after[BY_FORCE] = 0.0; /* not what another source left there */
  }
  if (signals->late || signals->source != 1) {
    return;
  }
  const double force = signals->force[place.tendon], compliance = signals->inverse_stiffness[place.tendon];
  const double pull = fabs(force) * compliance; /* f/k, m */
  const double root = sqrt(1.0 + 4.0 * values[0] * compliance * pull);
  const double stretch = 2.0 * pull / (1.0 + root);
  signals->position[place.tendon] += copysign(pull - stretch, force);
  /* 0 = k e + h e² − |f|: ∂e/∂|f| = 1/(k + 2 h e), and k + 2 h e = k·root */
  after[BY_FORCE] = compliance - compliance / root;
}

static void signal_pass(effect_place place, const double* values, const double* memory, effect_signals* direction) {
  (void)values;
  if (!direction->late) {
    direction->position[place.tendon] += memory[BY_FORCE] * direction->force[place.tendon];
  }
}

const effect_type effect_tendon_nonlinearity = {
    TENDON_NONLINEARITY_FACTS,    .kind = EFFECT_SIGNAL, .order = 2,
    .memory_count = MEMORY_COUNT, .signal = signal,      .signal_pass = signal_pass,
};
