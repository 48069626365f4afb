#include "floating_point.h"

#include "effect_facts.h"

/* Play: what is behind it follows a position at half the width (Krasnosel'skii and Pokrovskii 1989). */

enum { BEHIND, FOLLOWS, MEMORY_COUNT };

/* the position that has the play; NULL: not this time, or the kinematics source does not use it */
static double* position_of(effect_place place, const effect_signals* signals) {
  if (place.joint != EFFECT_NOWHERE) {
    return signals->late ? signals->angle + place.joint : NULL;
  }
  return !signals->late && signals->source == 1 ? signals->position + place.tendon : NULL;
}

static void signal(effect_place place, const double* values, effect_signals* signals, const double* before,
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
static void signal_pass(effect_place place, const double* values, const double* memory, effect_signals* direction) {
  (void)values;
  double* position = position_of(place, direction);
  if (position && memory[FOLLOWS] == 0.0) {
    *position = 0.0;
  }
}

const effect_type effect_backlash = {
    BACKLASH_FACTS,   .kind = EFFECT_SIGNAL,      .order = 1, .memory_count = MEMORY_COUNT,
    .signal = signal, .signal_pass = signal_pass,
};
