/* The detector of method "bands": what changes within four times, over bounds learned from free motion
 * (docs/reference/semantics/detection.md). contact_detector.c decides, kernel/band_watch.h computes. */
#pragma once

#include <stddef.h>

enum {
  BANDS = 4,        /* 4 ms, 20 ms, 60 ms, 0.5 s */
  BAND_NUMBERS = 6, /* of a band and joint: contact.bands */
  BAND_TERMS = 8    /* change, what of it counts, and what each number is multiplied by */
};

/* What a joint remembers: doubles alone, since it is a part of the saved state. */
typedef struct band_memory {
  double mean[BANDS], reference[BANDS];          /* a, m of e: N·m */
  double load[BANDS], load_reference[BANDS];     /* the same of x: N·m */
  double torque[BANDS], torque_reference[BANDS]; /* the same of T: N·m */
  double driven[BANDS], reserve[BANDS];          /* D, S: N·m */
  double home;                                   /* h, N·m */
  double unknown;                                /* V: what friction holds since a touch is not known, N·m */
  double begun_at, touched_at;                   /* t_0, begin of the contact: s */
  double base, sign, peak;                       /* of the contact: N·m, ±1, N·m */
  double friction, limit;                        /* |T|, B of the last sample: N·m */
  double has_moved;                              /* 0 until friction has turned over */
  double turned;                                 /* W: the largest friction until then, N·m */
  double start;                                  /* q at the first sample, rad */
} band_memory;

/* A joint at one sample. */
typedef struct band_sample {
  double residual; /* e, N·m */
  double load;     /* x */
  double torque;   /* T */
  double limit;    /* B */
  double reserve;  /* U */
  double angle;    /* q, rad */
} band_sample;

/* What depends on the step alone. */
typedef struct band_shares {
  double mean[BANDS], reference[BANDS]; /* of a new value */
  double kept[BANDS];                   /* of D and S */
  double held;                          /* of a reference in contact, a base, and home without contact */
  double unknown;
  double step; /* s */
} band_shares;

extern const double band_mean_time[BANDS], band_reference_time[BANDS]; /* A, M, s */

/* max(V, W): friction whose state nobody knows, N·m. */
static inline double band_unknown(const band_memory* joint) {
  return joint->unknown > joint->turned ? joint->unknown : joint->turned;
}
