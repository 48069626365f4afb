#include "floating_point.h"

#include "parameter_derivative.h"

#include <string.h>

#include "extensions.h"
#include "slot_view.h"

enum { NO_LAW = 0xffffffffu, LAWS_OF_PLACE = 2, SIDES_OF_JUMP = 2 };

#define NEARLY_SLIPS 1e-9 /* of a limit: rounding */

/* --- where things are -----------------------------------------------------------------------------------------------
 */

typedef struct sizes {
  size_t records, rows, joints, places, friction, bias, plain;
} sizes;

static sizes sizes_of(const tendonfmu_finger* f) {
  const size_t places = f->tendons * 2 * f->joints + 2 * f->joints;
  return (sizes){.records = 2 + (size_t)f->shape.edge_law_count + 2 * (size_t)f->shape.edge_count,
                 .rows = f->joints * f->tendon_lanes,
                 .joints = f->joint_lanes,
                 .places = places,
                 .friction = places * LAWS_OF_PLACE,
                 .bias = places * LAWS_OF_PLACE * SIDES_OF_JUMP,
                 .plain = 2 * f->joints};
}

size_t parameter_derivative_size(const tendonfmu_finger* finger) {
  const sizes s = sizes_of(finger);
  const size_t words = 2 * (s.records + s.rows + 2 * s.joints);
  return (words + 1) / 2 * 2 * sizeof(uint32_t) + (s.friction + s.bias) * sizeof(law_term) +
         s.plain * sizeof(plain_term) +
         ((3 * finger->joints + MODEL_MAX_ELEMENTS) * s.places + 4 * finger->joints) * sizeof(double);
}

typedef struct law_search {
  const tendonfmu_finger* finger;
  parameter_derivative* found;
  uint32_t next_record; /* as derived_numbers.c counts them */
  uint32_t points;      /* working points of the edge being read */
} law_search;

static void note_law(uint32_t* const side[2], size_t at, const model_item* item) {
  side[0][at] = item->first;
  side[1][at] = item->first + (item->law == LAW_ASYMMETRIC ? 4 : 0);
}

/* an edge with K laws has K + 2 records: L1 L1 L2 … LK LK */
static void note_edge(law_search* search, const model_item* item) {
  const uint32_t points = item->has_angles ? search->points : 1;
  uint32_t* const* side = search->found->edge_side;
  const uint32_t first = search->next_record;
  note_law(side, first + item->point + 1, item);
  if (item->point == 0) {
    note_law(side, first, item);
  }
  if (item->point + 1 == points) {
    note_law(side, first + points + 1, item);
    search->next_record += points + 2;
  }
}

static void note_cover(parameter_derivative* d, uint32_t parameter, uint32_t joint) {
  d->plain[d->plain_count++] = (plain_term){.parameter = parameter, .joint = joint};
}

static int note_item(void* context, const model_item* item) {
  law_search* search = context;
  const size_t lanes = search->finger->tendon_lanes;
  switch (item->kind) {
    case ITEM_JOINT_FRICTION: note_law(search->found->joint_side, item->joint, item); break;
    case ITEM_LOAD_FRICTION: note_law(search->found->load_side, item->joint, item); break;
    case ITEM_PULLEY_FRICTION:
      note_law(search->found->pulley_side, (item->joint + 1) * lanes + item->tendon, item);
      break;
    case ITEM_EDGE_ANGLES: search->points = item->count; break;
    case ITEM_EDGE_FRICTION: note_edge(search, item); break;
    case ITEM_COVER:
      note_cover(search->found, item->first, item->joint);
      note_cover(search->found, item->first + 1, item->joint);
      break;
    default: break;
  }
  return 0;
}

static void* take(unsigned char** from, size_t bytes) {
  void* place = *from;
  *from += bytes;
  return place;
}

void parameter_derivative_place(const tendonfmu_finger* finger, void* memory, parameter_derivative* derivative) {
  const sizes s = sizes_of(finger);
  const size_t n = finger->joints, matrix = s.places * n * sizeof(double);
  unsigned char* from = memory;
  memset(memory, 0, parameter_derivative_size(finger));
  *derivative = (parameter_derivative){.joints = n, .tendons = finger->tendons, .places = s.places};
  derivative->torque_factor = take(&from, matrix);
  derivative->jump_factor = take(&from, matrix);
  derivative->bias_factor = take(&from, matrix);
  derivative->by_limit = take(&from, MODEL_MAX_ELEMENTS * s.places * sizeof(double));
  derivative->moved = take(&from, 2 * n * sizeof(double));
  derivative->jumped = take(&from, 2 * n * sizeof(double));
  derivative->friction = take(&from, s.friction * sizeof(law_term));
  derivative->bias = take(&from, s.bias * sizeof(law_term));
  derivative->plain = take(&from, s.plain * sizeof(plain_term));
  uint32_t* words = take(&from, 0);
  const size_t count = 2 * (s.records + s.rows + 2 * s.joints);
  for (size_t k = 0; k < count; ++k) {
    words[k] = NO_LAW;
  }
  for (int negative = 0; negative < 2; ++negative) {
    derivative->edge_side[negative] = words;
    derivative->pulley_side[negative] = words + s.records;
    derivative->joint_side[negative] = words + s.records + s.rows;
    derivative->load_side[negative] = words + s.records + s.rows + s.joints;
    words += count / 2;
  }
  law_search search = {.finger = finger, .found = derivative, .next_record = 2};
  model_visit(&finger->shape, note_item, &search);
}

/* --- what F and b depend on -----------------------------------------------------------------------------------------
 */

/* One place at the last sample. */
typedef struct place_laws {
  uint32_t place;
  size_t slot;
  double threshold;            /* v_min */
  const double *below, *above; /* packed laws; above NULL: no working points */
  const uint32_t *below_side[2], *above_side[2];
  double weight; /* of the working point above */
} place_laws;

static void add_side(law_term* to, size_t* count, uint32_t place, uint32_t side, double speed, const law_slopes* s,
                     double factor) {
  to[(*count)++] =
      (law_term){.place = place,
                 .side = side,
                 .speed = speed,
                 .slope = {factor * s->by_static, factor * s->by_coulomb, factor * s->by_rate, factor * s->by_viscous}};
}

/* appends the slopes of factor·|F(speed)| on one side; returns that value */
static double add_magnitude(const place_laws* p, int negative, double speed, double factor, law_term* to,
                            size_t* count) {
  const law_slopes below = law_with_slopes(p->below + negative * LAW_SIDE_NUMBERS, speed);
  double value = below.value;
  if (p->above && p->weight != 0.0) {
    const law_slopes above = law_with_slopes(p->above + negative * LAW_SIDE_NUMBERS, speed);
    value += p->weight * (above.value - below.value);
    add_side(to, count, p->place, *p->above_side[negative], speed, &above, factor * p->weight);
    factor *= 1.0 - p->weight;
  }
  add_side(to, count, p->place, *p->below_side[negative], speed, &below, factor);
  return value;
}

/* |F| of the law, with its slopes */
static double read_magnitude(const tendonfmu_finger* f, const place_laws* p, parameter_derivative* d) {
  const double v = f->scratch.velocity[p->slot], speed = v < 0.0 ? -v : v;
  const double grip = f->extensions.friction ? f->scratch.grip[p->slot] : 1.0;
  return grip * add_magnitude(p, v < 0.0, speed, grip, d->friction, &d->friction_count);
}

/* slopes of |F| to those of F: the terms from `first` on */
static void scale_slopes(parameter_derivative* d, size_t first, double share) {
  for (law_term* term = d->friction + first; term < d->friction + d->friction_count; ++term) {
    for (size_t k = 0; k < LAW_SIDE_NUMBERS; ++k) {
      term->slope[k] *= share;
    }
  }
}

/* whether the friction of a slot remembers (docs/reference/semantics/presliding.md) */
static int remembers(const tendonfmu_finger* f, size_t slot) {
  return f->memory.elements && f->memory.remembers[slot] != 0.0;
}

/* slope of what a slot's elements hold by its limit: what slips has its sign, and what is free keeps what it had; in
 * the relative form all that is held is in proportion to the limit */
static double slope_by_limit(const tendonfmu_finger* f, parameter_derivative* d, size_t slot, uint32_t place,
                             double limit) {
  double slope = 0.0;
  const int tendon = place < 2 * f->joints * f->tendons;
  for (size_t e = 0; e < f->memory.elements; ++e) {
    const friction_element* element = &f->memory.element[e];
    const size_t row = 2 * e + (tendon ? place % 2 : 0); /* edges, pulleys */
    const double held = f->remembered.element[row * f->slots + slot], most = element->share[slot] * limit;
    const double size = held < 0.0 ? -held : held, sign = held < 0.0 ? -1.0 : 1.0;
    double* own = d->by_limit + e * d->places + place;
    if (size >= (1.0 - NEARLY_SLIPS) * most) {
      *own = most > 0.0 ? sign : 0.0;
    } else if (element->stiffness[slot] == 0.0) {
      *own = held / most;
    } else {
      const double yield =
          tendon && f->memory.stretch > 0.0 ? element->stiff[slot] * f->memory.sections[slot] * f->memory.stretch : 0.0;
      *own *= (element->kept[slot] + yield) / (1.0 + yield);
    }
    slope += element->share[slot] * *own;
  }
  return slope;
}

/* F of an edge or a pulley where the acting force is known: 0 where it sticks; by its laws, if it remembers */
static double read_friction(const tendonfmu_finger* f, const place_laws* p, double acting, parameter_derivative* d) {
  const size_t first = d->friction_count;
  const int held = remembers(f, p->slot);
  if (f->remembered.moving[p->slot] == 0.0 && !held) {
    return 0.0;
  }
  const double most = read_magnitude(f, p, d), sign = f->scratch.velocity[p->slot] < 0.0 ? -1.0 : 1.0;
  const double share = held ? slope_by_limit(f, d, p->slot, p->place, acting * most) : sign;
  scale_slopes(d, first, share);
  return share * most;
}

/* b of fig. 5 where a place comes to rest */
static double read_stop(const place_laws* p, double side, double grip, parameter_derivative* d) {
  return side * add_magnitude(p, side < 0.0, p->threshold, grip * side, d->bias, &d->bias_count);
}

/* b of fig. 5 where it leaves rest */
static double read_start(const tendonfmu_finger* f, const place_laws* p, double before, double now, double grip,
                         parameter_derivative* d) {
  const double kept = before == 0.0 ? 0.0 : law_exponential(rest_exponent(f, p->slot));
  const double factor = -(1.0 - kept) * now;
  double jump = factor * add_magnitude(p, now < 0.0, p->threshold, grip * factor, d->bias, &d->bias_count);
  if (kept != 0.0) {
    const double back = -kept * before;
    jump += back * add_magnitude(p, before < 0.0, p->threshold, grip * back, d->bias, &d->bias_count);
  }
  return jump;
}

static double read_jump(const tendonfmu_finger* f, const place_laws* p, parameter_derivative* d) {
  const finger_state* s = &f->remembered;
  const double before = s->side_before[p->slot], now = s->side[p->slot], event = s->event[p->slot];
  const double grip = f->extensions.friction ? f->scratch.bias_grip[p->slot] : 1.0;
  if (event == 0.0 || grip == 0.0 || remembers(f, p->slot) || (event > 0.0 && before == 0.0)) {
    return 0.0;
  }
  const double jump = event > 0.0 ? read_stop(p, before, grip, d) : read_start(f, p, before, now, grip, d);
  return grip * jump;
}

static place_laws edge_at(const tendonfmu_finger* f, const parameter_derivative* d, size_t i, size_t j) {
  const size_t slot = j * f->tendon_lanes + i;
  const double angle = j ? f->remembered.angle[j - 1] : 0.0;
  const size_t record = f->derived.edge_record[slot] + slot_segment(f, j, i, angle);
  const double* segment = f->derived.edge_segment + 2 * record;
  place_laws p = {.place = (uint32_t)(2 * (i * f->joints + j)),
                  .slot = slot,
                  .threshold = f->derived.settings.tendon_threshold,
                  .below = f->derived.edge_law + record * LAW_NUMBERS,
                  .above = segment[1] != 0.0 ? f->derived.edge_law + (record + 1) * LAW_NUMBERS : NULL,
                  .weight = (angle - segment[0]) * segment[1]};
  for (int negative = 0; negative < 2; ++negative) {
    p.below_side[negative] = d->edge_side[negative] + record;
    p.above_side[negative] = d->edge_side[negative] + record + (p.above != NULL);
  }
  return p;
}

static place_laws single_law(uint32_t place, size_t slot, double threshold, const double* law, uint32_t* const side[2],
                             size_t at) {
  return (place_laws){
      .place = place, .slot = slot, .threshold = threshold, .below = law, .below_side = {side[0] + at, side[1] + at}};
}

/* --- what F does to the torques -------------------------------------------------------------------------------------
 */

/* The forces along one tendon: before[k] acts at place k of 2n. */
typedef struct tendon_forces {
  double acting[2 * MODEL_MAX_JOINTS + 1];
  double by_force[2 * MODEL_MAX_JOINTS + 1]; /* ∂acting/∂force: ±1, 0 where slack replaced the force by 0 */
} tendon_forces;

static void act(const tendonfmu_finger* f, size_t i, double* force, double* acting, double* by_force) {
  const int bidirectional = f->derived.bidirectional[i] != 0.0, negative = *force < 0.0;
  *by_force = negative ? (bidirectional ? -1.0 : 0.0) : 1.0;
  if (negative && !bidirectional) {
    *force = 0.0;
  }
  *acting = *force < 0.0 ? -*force : *force;
}

static void follow_forces(const tendonfmu_finger* f, size_t i, tendon_forces* t) {
  const finger_scratch* s = &f->scratch;
  double force = f->remembered.force[i];
  for (size_t k = 0; k < 2 * f->joints; ++k) {
    const size_t at = k / 2 * f->tendon_lanes + i;
    act(f, i, &force, &t->acting[k], &t->by_force[k]);
    force -= k % 2 == 0 ? s->edge_loss[at] : k + 1 < 2 * f->joints ? s->pulley_loss[at + f->tendon_lanes] : 0.0;
  }
  act(f, i, &force, &t->acting[2 * f->joints], &t->by_force[2 * f->joints]);
}

/* factors of place k of tendon i: a change of F there, and what it does to forces, losses and jumps behind it */
static void follow_change(const tendonfmu_finger* f, parameter_derivative* d, size_t i, size_t k,
                          const tendon_forces* t) {
  const finger_scratch* s = &f->scratch;
  const size_t n = f->joints, row = (i * 2 * n + k) * n;
  const int jumps = d->has_jump;
  double force = -t->acting[k], lost = t->acting[k], jumped = 0.0;
  for (size_t j = 0; j <= k / 2; ++j) {
    d->torque_factor[row + j] = d->jump_factor[row + j] = d->bias_factor[row + j] = 0.0;
  }
  for (size_t next = k + 1; next <= 2 * n; ++next) {
    if (next % 2 == 0 || next == 2 * n) { /* past the pulley of joint j */
      const size_t j = next / 2 - 1;
      const double arm = f->derived.moment_arm[j * f->tendon_lanes + i];
      d->torque_factor[row + j] += arm * lost;
      if (jumps) {
        d->jump_factor[row + j] += arm * jumped;
        d->bias_factor[row + j] = arm * t->acting[k];
      }
    }
    if (next == 2 * n) {
      break;
    }
    const double acting = t->by_force[next] * force;
    if (next % 2 == 1) { /* f_B of joint j, just past its edge */
      const size_t j = next / 2;
      d->torque_factor[row + j] = s->load_friction[j] * acting;
      d->jump_factor[row + j] = jumps ? s->load_bias[j] * acting : 0.0;
    }
    jumped += acting * d->jumped[next];
    lost += acting * d->moved[next];
    force = t->by_force[next] != 0.0 ? force - acting * d->moved[next] : 0.0;
  }
}

static void read_tendon(const tendonfmu_finger* f, parameter_derivative* d, size_t i) {
  const size_t n = f->joints, lanes = f->tendon_lanes;
  const finger_scratch* s = &f->scratch;
  int present[2 * MODEL_MAX_JOINTS] = {0};
  tendon_forces forces;
  for (size_t j = 0; j < n; ++j) {
    const place_laws edge = edge_at(f, d, i, j);
    const size_t at = j * lanes + i, behind = at + lanes;
    d->moved[2 * j] = d->jumped[2 * j] = d->moved[2 * j + 1] = d->jumped[2 * j + 1] = 0.0;
    if (*edge.below_side[0] != NO_LAW) {
      present[2 * j] = 1;
      d->moved[2 * j] = read_friction(f, &edge, s->force_at[at], d);
      d->jumped[2 * j] = read_jump(f, &edge, d);
    }
    if (j + 1 < n && d->pulley_side[0][behind] != NO_LAW) {
      place_laws pulley = single_law(edge.place + 1, behind, f->derived.settings.tendon_threshold,
                                     f->derived.pulley_law + behind * LAW_NUMBERS, d->pulley_side, behind);
      present[2 * j + 1] = 1;
      d->moved[2 * j + 1] = read_friction(f, &pulley, s->force_between[at], d);
      d->jumped[2 * j + 1] = read_jump(f, &pulley, d);
    }
  }
  follow_forces(f, i, &forces);
  for (size_t k = 0; k + 1 < 2 * n; ++k) {
    if (present[k]) {
      follow_change(f, d, i, k, &forces);
    }
  }
}

static void read_joint(const tendonfmu_finger* f, parameter_derivative* d, size_t j) {
  const size_t n = f->joints, slot = n * f->tendon_lanes + j;
  const uint32_t place = (uint32_t)(2 * n * f->tendons + 2 * j);
  const double threshold = f->derived.settings.joint_threshold;
  const double load = f->scratch.load[j], factor[2] = {1.0, load};
  const size_t first = d->friction_count;
  double limit = f->scratch.own_limit[j];
  for (int loaded = 0; loaded < 2; ++loaded) {
    uint32_t* const* side = loaded ? d->load_side : d->joint_side;
    const double* laws = loaded ? f->derived.load_law : f->derived.joint_law;
    const size_t row = (place + (size_t)loaded) * n;
    if (side[0][j] == NO_LAW) {
      continue;
    }
    place_laws own = single_law(place + (uint32_t)loaded, slot, threshold, laws + j * LAW_NUMBERS, side, j);
    if (f->remembered.moving[slot] != 0.0 || remembers(f, slot)) {
      limit += factor[loaded] * read_magnitude(f, &own, d);
    }
    read_jump(f, &own, d);
    for (size_t other = 0; other < n; ++other) {
      d->torque_factor[row + other] = d->jump_factor[row + other] = d->bias_factor[row + other] = 0.0;
    }
    d->torque_factor[row + j] = d->bias_factor[row + j] = factor[loaded];
  }
  const double sign = f->scratch.velocity[slot] < 0.0 ? -1.0 : 1.0;
  scale_slopes(d, first, remembers(f, slot) ? slope_by_limit(f, d, slot, place, limit) : sign);
}

static void read_covers(const tendonfmu_finger* f, parameter_derivative* d) {
  for (size_t k = 0; k < d->plain_count; k += 2) {
    const uint32_t j = d->plain[k].joint;
    d->plain[k].slope = f->remembered.angle[j] - f->derived.cover_rest[j];
    d->plain[k + 1].slope = -f->derived.cover_stiffness[j];
  }
}

static int any_transition(const tendonfmu_finger* f) {
  double events = 0.0;
  for (size_t slot = 0; slot < f->slots; ++slot) {
    events += f->remembered.event[slot] * f->remembered.event[slot];
  }
  return events != 0.0;
}

void parameter_derivative_read(const tendonfmu_finger* finger, parameter_derivative* derivative) {
  derivative->friction_count = derivative->bias_count = 0;
  derivative->has_jump = any_transition(finger);
  for (size_t i = 0; i < finger->tendons; ++i) {
    read_tendon(finger, derivative, i);
  }
  for (size_t j = 0; j < finger->joints; ++j) {
    read_joint(finger, derivative, j);
  }
  read_covers(finger, derivative);
}
