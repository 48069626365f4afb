#include "floating_point.h"

#include "contact_bands.h"

#include <math.h>

static const double mean_time[BANDS] = {0.004, 0.02, 0.06, 0.5};    /* A, s */
static const double reference_time[BANDS] = {0.05, 0.3, 1.0, 10.0}; /* M, s */

#define HELD_TIME    10.0  /* s, H: with which home follows, and references and bases in contact */
#define UNKNOWN_TIME 1.0   /* s */
#define SHORTEST     0.02  /* s, of a contact */
#define HIGHEST      1e300 /* square of a level */
#define TURNED       0.5   /* of all that friction can hold: then the start is behind, */
#define MOVED        0.1   /* rad; or so far from it */
#define END          0.4   /* of its peak, below which a contact has ended */

enum { HOME_BAND = 1, END_BAND = 2, RESERVE_BAND = 2 };

static double larger(double a, double b) {
  return a > b ? a : b;
}

static double smaller(double a, double b) {
  return a < b ? a : b;
}

/* what depends on the step alone */
static void find_shares_of_step(band_shares* shares, double step, exponentials* one_minus_exponentials) {
  _Alignas(32) double value[12] = {[8] = step / HELD_TIME, [9] = step / UNKNOWN_TIME};
  for (size_t k = 0; k < BANDS; ++k) {
    value[k] = step / mean_time[k];
    value[BANDS + k] = step / reference_time[k];
  }
  one_minus_exponentials(value, value, 12);
  shares->step = step;
  for (size_t k = 0; k < BANDS; ++k) {
    shares->mean[k] = value[k];
    shares->reference[k] = value[BANDS + k];
    shares->kept[k] = 1.0 - shares->reference[k];
  }
  shares->held = value[8];
  shares->unknown = 1.0 - value[9];
}

void band_find_shares(band_shares* shares, double* young, const band_memory* bands, size_t joints, double time,
                      double step, exponentials* one_minus_exponentials) {
  int any = 0;
  if (shares->step != step) {
    find_shares_of_step(shares, step, one_minus_exponentials);
  }
  for (size_t j = 0; j < joints; ++j) {
    const double age = time - bands[j].begun_at;
    young[j] = step / age;
    any |= age < reference_time[BANDS - 1];
  }
  if (any) {
    one_minus_exponentials(young, young, (joints + 3) / 4 * 4);
  }
}

void band_begin(band_memory* joint, const band_sample* sample, double time, double unknown, int first) {
  for (size_t k = 0; k < BANDS; ++k) {
    joint->mean[k] = joint->reference[k] = sample->residual;
    joint->load[k] = joint->load_reference[k] = sample->load;
    joint->torque[k] = joint->torque_reference[k] = sample->torque;
    joint->driven[k] = 0.0;
    joint->reserve[k] = first ? 0.0 : joint->reserve[k];
  }
  joint->home = first ? sample->residual : joint->home;
  joint->has_moved = first ? 0.0 : joint->has_moved;
  joint->turned = first ? 0.0 : joint->turned;
  joint->start = first ? sample->angle : joint->start;
  joint->unknown = unknown;
  joint->begun_at = joint->touched_at = time;
  joint->base = joint->sign = joint->peak = 0.0;
  joint->friction = fabs(sample->torque);
  joint->limit = sample->limit;
}

/* σ of the means and the references of a joint that began `age` ago: means of what there has been since */
static void find_shares_since(const band_shares* shares, double age, double young, double* quick, double* slow) {
  for (size_t k = 0; k < BANDS; ++k) {
    quick[k] = age < mean_time[k] ? young : shares->mean[k];
    slow[k] = age < reference_time[k] ? young : shares->reference[k];
  }
}

/* four means of a value, and the means of those */
static void follow(double* mean, double* reference, double value, const double* quick, const double* slow) {
  for (size_t k = 0; k < BANDS; ++k) {
    mean[k] += quick[k] * (value - mean[k]);
    reference[k] += slow[k] * (mean[k] - reference[k]);
  }
}

static void follow_sample(band_memory* joint, const band_sample* sample, const band_shares* shares, double age,
                          double young, int any) {
  double quick[BANDS], slow[BANDS], own[BANDS];
  find_shares_since(shares, age, young, quick, slow);
  for (size_t k = 0; k < BANDS; ++k) {
    own[k] = any ? shares->held : slow[k];
  }
  follow(joint->mean, joint->reference, sample->residual, quick, own);
  follow(joint->load, joint->load_reference, sample->load, quick, slow);
  follow(joint->torque, joint->torque_reference, sample->torque, quick, slow);
  for (size_t k = 0; k < BANDS; ++k) {
    joint->driven[k] = larger(joint->driven[k] * shares->kept[k], fabs(joint->load[k] - joint->load_reference[k]));
    joint->reserve[k] = larger(joint->reserve[k] * shares->kept[k], sample->reserve);
  }
  if (!any) {
    joint->home += shares->held * (joint->mean[HOME_BAND] - joint->home);
  }
  joint->unknown *= shares->unknown;
  joint->friction = fabs(sample->torque);
  joint->limit = sample->limit;
}

double band_unknown(const band_memory* joint) {
  return larger(joint->unknown, joint->turned);
}

band_terms find_band_terms(const band_memory* joint) {
  band_terms terms;
  for (size_t k = 0; k < BANDS; ++k) {
    const double mean = joint->mean[k], change = mean - joint->reference[k];
    const double from_home = copysign(1.0, change) * (mean - joint->home);
    const double size = larger(0.0, smaller(fabs(change), from_home));
    const double turned = fabs(joint->torque[k] - joint->torque_reference[k]);
    terms.of[0][k] = change;
    terms.of[1][k] = copysign(size, change);
    terms.of[2][k] = 1.0;
    terms.of[3][k] = joint->friction;
    terms.of[4][k] = joint->limit;
    terms.of[5][k] = joint->driven[k];
    terms.of[6][k] = smaller(turned, joint->driven[k]);
    terms.of[7][k] = smaller(joint->reserve[k], joint->driven[RESERVE_BAND]);
  }
  return terms;
}

/* the largest share of its bound that what counts of a band's change has, both squared; and of which band */
static double find_largest(const band_memory* joint, const double* squares, size_t* band) {
  const band_terms terms = find_band_terms(joint);
  const double unknown = band_unknown(joint);
  double bound[BANDS], most = 0.0, bound_of_most = 1.0;
  for (size_t k = 0; k < BANDS; ++k) {
    bound[k] = unknown * unknown;
    for (size_t i = 0; i < BAND_NUMBERS; ++i) {
      bound[k] += squares[i * BANDS + k] * (terms.of[2 + i][k] * terms.of[2 + i][k]);
    }
  }
  *band = 0;
  for (size_t k = 0; k < BANDS; ++k) {
    const double size = terms.of[1][k] * terms.of[1][k];
    if (size * bound_of_most > most * bound[k]) { /* one division for all bands */
      most = size;
      bound_of_most = bound[k];
      *band = k;
    }
  }
  return most / bound_of_most;
}

double band_take(band_memory* joint, const band_sample* sample, const band_shares* shares, double young,
                 const double squares[BANDS * BAND_NUMBERS], double time, int before, int any, size_t* band) {
  follow_sample(joint, sample, shares, time - joint->begun_at, young, any);
  if (joint->has_moved == 0.0) {
    joint->turned = larger(joint->turned, sample->limit - sample->reserve);
    if (!before && joint->turned > TURNED * sample->limit) {
      band_begin(joint, sample, time, sample->limit, 1);
      joint->has_moved = 1.0;
      *band = 0;
      return 0.0;
    }
    if (fabs(sample->angle - joint->start) > MOVED) {
      joint->turned = 0.0;
      joint->has_moved = 1.0;
    }
  }
  return sqrt(smaller(find_largest(joint, squares, band), HIGHEST));
}

int band_decide(band_memory* joint, const band_sample* sample, const band_shares* shares, double time, double rounding,
                int before, double level, size_t band) {
  if (!before) {
    if (!(level > 1.0)) {
      return 0;
    }
    const double reference = joint->reference[band], home = joint->home;
    joint->sign = joint->mean[band] < reference ? -1.0 : 1.0;
    joint->base = joint->sign < 0.0 ? smaller(reference, home) : larger(reference, home);
    joint->peak = 0.0;
    joint->touched_at = time;
    return 1;
  }
  joint->base += shares->held * (joint->mean[END_BAND] - joint->base);
  const double now = (joint->mean[END_BAND] - joint->base) * joint->sign;
  joint->peak = larger(joint->peak, now);
  if (time - joint->touched_at > SHORTEST + rounding && now < END * joint->peak) {
    band_begin(joint, sample, time, joint->peak, 0);
    return 0;
  }
  return 1;
}
