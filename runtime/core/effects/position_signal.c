#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>

/* A progressive spring: |f| = k e + hardening e². The position is corrected so that subtracting f/k leaves x0 − e. */

enum { BY_FORCE, SPRING_NUMBERS }; /* of the correction, m/N */

static void spring_signal(const extension_row* row, effect_signals* signals) {
  const size_t i = row->place.tendon;
  if (signals->source != 1) {
    row->now[BY_FORCE] = 0.0; /* not what another source left there */
  }
  if (signals->late || signals->source != 1) {
    return;
  }
  const double force = signals->force[i], compliance = signals->inverse_stiffness[i];
  const double pull = fabs(force) * compliance; /* f/k, m */
  const double root = sqrt(1.0 + 4.0 * row->parameters[0] * compliance * pull);
  const double stretch = 2.0 * pull / (1.0 + root);
  signals->position[i] += copysign(pull - stretch, force);
  /* 0 = k e + h e² − |f|: ∂e/∂|f| = 1/(k + 2 h e), and k + 2 h e = k·root */
  row->now[BY_FORCE] = compliance - compliance / root;
}

static void spring_pass(const extension_row* row, effect_signals* direction) {
  if (!direction->late) {
    direction->position[row->place.tendon] += row->now[BY_FORCE] * direction->force[row->place.tendon];
  }
}

const effect_action tendon_nonlinearity_action = {.kind = EFFECT_SIGNAL,
                                                  .order = 2,
                                                  .memory_count = SPRING_NUMBERS,
                                                  .signal = spring_signal,
                                                  .signal_pass = spring_pass};

/* Play: what is behind it follows a position at half the width (Krasnosel'skii and Pokrovskii 1989). */

enum { BEHIND, FOLLOWS, PLAY_NUMBERS };

/* the position that has the play; NULL: not this time, or the kinematics source does not use it */
static double* position_of(effect_place place, const effect_signals* signals) {
  if (place.joint != EFFECT_NOWHERE) {
    return signals->late ? signals->angle + place.joint : NULL;
  }
  return !signals->late && signals->source == 1 ? signals->position + place.tendon : NULL;
}

static void play_signal(const extension_row* row, effect_signals* signals) {
  double* position = position_of(row->place, signals);
  if (!position) {
    if (row->place.tendon != EFFECT_NOWHERE && signals->source != 1) {
      row->now[BEHIND] = row->now[FOLLOWS] = 0.0; /* not what another source left there */
    }
    return;
  }
  const double half = 0.5 * row->parameters[0], x = *position, behind = row->before[BEHIND];
  const int above = !signals->first && x - half > behind, below = !signals->first && x + half < behind;
  row->now[BEHIND] = signals->first ? x : above ? x - half : below ? x + half : behind;
  row->now[FOLLOWS] = signals->first || above || below || half == 0.0 ? 1.0 : 0.0;
  *position = row->now[BEHIND];
}

/* inside the play it stays what it was */
static void play_pass(const extension_row* row, effect_signals* direction) {
  double* position = position_of(row->place, direction);
  if (position && row->now[FOLLOWS] == 0.0) {
    *position = 0.0;
  }
}

const effect_action backlash_action = {
    .kind = EFFECT_SIGNAL, .order = 1, .memory_count = PLAY_NUMBERS, .signal = play_signal, .signal_pass = play_pass};
