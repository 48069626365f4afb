/* The detector of method "bands": what changes within four times, over bounds learned from free motion
 * (docs/reference/semantics/detection.md). Scalar code, compiled once. */
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
  double step;                          /* s */
  double mean[BANDS], reference[BANDS]; /* of a new value */
  double kept[BANDS];                   /* of D and S */
  double held;                          /* of a reference in contact, a base, and home without contact */
  double unknown;
} band_shares;

/* 1 − exp(−x) of a row (kernel_choice.h) */
typedef void exponentials(const double* x, double* values, size_t count);

/* Fills the shares of this step, and into young [N] those of joints whose means have just begun. */
void band_find_shares(band_shares* shares, double* young, const band_memory* bands, size_t joints, double time,
                      double step, exponentials* one_minus_exponentials);

/* A joint begins anew; unknown: V. First: at the first sample, where it was not watched, and when it first moves. */
void band_begin(band_memory* joint, const band_sample* sample, double time, double unknown, int first);

/* Takes a sample; of the one before: whether the joint was in contact, and whether any was. squares [BAND_NUMBERS ×
 * BANDS]. Returns the level. */
double band_take(band_memory* joint, const band_sample* sample, const band_shares* shares, double young,
                 const double squares[BANDS * BAND_NUMBERS], double time, int before, int any, size_t* band);

/* Whether a joint is in contact now, from whether it was, its level and the band that has it. */
int band_decide(band_memory* joint, const band_sample* sample, const band_shares* shares, double time, double rounding,
                int before, double level, size_t band);

/* max(V, W): friction whose state nobody knows, N·m. */
double band_unknown(const band_memory* joint);

typedef struct band_terms {
  double of[BAND_TERMS][BANDS];
} band_terms;

band_terms find_band_terms(const band_memory* joint);
