#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>
#include <string.h>

/* Positions, or forces, of a while ago, from the last samples by linear interpolation. */

enum { KEPT = 64 };

/* memory: the newest of the kept samples, how many there are, whether they are forces, the share of this sample in what
 * comes out; their times; the samples [KEPT × width] */
enum { NEWEST, COUNT, FORCES, SHARE, TIMES };

/* room for what any kinematics source gives */
static size_t width_of(size_t joints, size_t tendons) {
  return tendons > 2 * joints ? tendons : 2 * joints;
}

static size_t state_count(size_t joints, size_t tendons, effect_place place) {
  (void)place;
  return TIMES + KEPT + KEPT * width_of(joints, tendons);
}

/* The rows that are late. */
typedef struct late_rows {
  double* row[2];
  size_t count[2];
} late_rows;

static late_rows rows_of(int forces, const effect_signals* s) {
  if (forces) {
    return (late_rows){{s->force, NULL}, {s->tendons, 0}};
  }
  if (s->source == 1) {
    return (late_rows){{s->position, NULL}, {s->tendons, 0}};
  }
  return (late_rows){{s->angle, s->velocity}, {s->joints, s->source == 3 ? s->joints : 0}};
}

static size_t whole_number(double value, size_t largest) {
  return value >= 0.0 && value <= (double)largest ? (size_t)value : 0; /* a state from outside may hold anything */
}

/* The two kept samples between which a time lies. */
typedef struct between {
  size_t older, newer;
  double weight; /* of the newer */
  int newest;    /* the newer one is the present sample */
} between;

static between samples_around(const double* times, size_t newest, size_t count, double wanted) {
  size_t newer = newest;
  for (size_t back = 1; back < count; ++back) {
    const size_t older = (newest + KEPT - back) % KEPT;
    if (times[older] <= wanted) {
      const double length = times[newer] - times[older];
      const int apart = length > 1e-300; /* so that the weight is finite */
      return (between){older, newer, apart ? (wanted - times[older]) / length : 1.0, newer == newest};
    }
    newer = older;
  }
  return (between){newer, newer, 1.0, newer == newest};
}

static void signal(const extension_row* row, effect_signals* signals) {
  if (signals->late) {
    return;
  }
  const size_t width = width_of(signals->joints, signals->tendons);
  const double *before = row->before, delay = row->parameters[0];
  double* now = row->now;
  memcpy(now, before, row->memory_count * sizeof(double));
  const int forces = delay < 0.0;
  const int begins = signals->first || (before[FORCES] != 0.0) != forces; /* or the parameter has changed its sign */
  const size_t count_before = begins ? 0 : whole_number(before[COUNT], KEPT);
  const size_t newest = count_before ? (whole_number(before[NEWEST], KEPT - 1) + 1) % KEPT : 0;
  const size_t count = count_before < KEPT ? count_before + 1 : KEPT;
  double *kept = now + TIMES + KEPT, *own = kept + newest * width;
  const late_rows rows = rows_of(forces, signals);
  now[NEWEST] = (double)newest;
  now[COUNT] = (double)count;
  now[FORCES] = forces ? 1.0 : 0.0;
  now[TIMES + newest] = signals->time;
  for (size_t r = 0, at = 0; r < 2; at += rows.count[r++]) {
    for (size_t i = 0; i < rows.count[r]; ++i) {
      own[at + i] = rows.row[r][i];
    }
  }
  const between b = samples_around(now + TIMES, newest, count, signals->time - fabs(delay));
  now[SHARE] = b.newest ? b.weight : 0.0;
  for (size_t r = 0, at = 0; r < 2; at += rows.count[r++]) {
    for (size_t i = 0; i < rows.count[r]; ++i) {
      const double older = kept[b.older * width + at + i], newer = kept[b.newer * width + at + i];
      rows.row[r][i] = newer + (1.0 - b.weight) * (older - newer);
    }
  }
}

static void signal_pass(const extension_row* row, effect_signals* direction) {
  if (direction->late) {
    return;
  }
  const late_rows rows = rows_of(row->now[FORCES] != 0.0, direction);
  for (size_t r = 0; r < 2; ++r) {
    for (size_t i = 0; i < rows.count[r]; ++i) {
      rows.row[r][i] *= row->now[SHARE];
    }
  }
}

const effect_action time_delay_action = {
    .kind = EFFECT_SIGNAL, .state_count = state_count, .signal = signal, .signal_pass = signal_pass};
