#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>

/* A progressive spring: |f| = k e + hardening e². The position is corrected so that subtracting f/k leaves x0 − e. */

enum { BY_FORCE, SPRING_NUMBERS }; /* of the correction, m/N */

static void spring_signal(effect_place place, const double* values, effect_signals* signals, const double* before,
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

static void spring_pass(effect_place place, const double* values, const double* memory, effect_signals* direction) {
  (void)values;
  if (!direction->late) {
    direction->position[place.tendon] += memory[BY_FORCE] * direction->force[place.tendon];
  }
}

const effect_type effect_tendon_nonlinearity = {
    TENDON_NONLINEARITY_FACTS,      .kind = EFFECT_SIGNAL,   .order = 2,
    .memory_count = SPRING_NUMBERS, .signal = spring_signal, .signal_pass = spring_pass,
};

/* Play: what is behind it follows a position at half the width (Krasnosel'skii and Pokrovskii 1989). */

enum { BEHIND, FOLLOWS, PLAY_NUMBERS };

/* the position that has the play; NULL: not this time, or the kinematics source does not use it */
static double* position_of(effect_place place, const effect_signals* signals) {
  if (place.joint != EFFECT_NOWHERE) {
    return signals->late ? signals->angle + place.joint : NULL;
  }
  return !signals->late && signals->source == 1 ? signals->position + place.tendon : NULL;
}

static void play_signal(effect_place place, const double* values, effect_signals* signals, const double* before,
                        double* after) {
  double* position = position_of(place, signals);
  if (!position) {
    if (place.tendon != EFFECT_NOWHERE && signals->source != 1) {
      after[BEHIND] = after[FOLLOWS] = 0.0; /* not what another source left there */
    }
    return;
  }
  const double half = 0.5 * values[0], x = *position;
  const int above = !signals->first && x - half > before[BEHIND], below = !signals->first && x + half < before[BEHIND];
  after[BEHIND] = signals->first ? x : above ? x - half : below ? x + half : before[BEHIND];
  after[FOLLOWS] = signals->first || above || below || half == 0.0 ? 1.0 : 0.0;
  *position = after[BEHIND];
}

/* inside the play it stays what it was */
static void play_pass(effect_place place, const double* values, const double* memory, effect_signals* direction) {
  (void)values;
  double* position = position_of(place, direction);
  if (position && memory[FOLLOWS] == 0.0) {
    *position = 0.0;
  }
}

const effect_type effect_backlash = {
    BACKLASH_FACTS,        .kind = EFFECT_SIGNAL,    .order = 1, .memory_count = PLAY_NUMBERS,
    .signal = play_signal, .signal_pass = play_pass,
};
