/* Sine and cosine with the same bits everywhere, without the host's libm: within 1 ulp of 1 for the angles of joints.
 * Angles beyond ±1e5 rad count as ±1e5. */
#pragma once

typedef struct sine_cosine {
  double sine, cosine;
} sine_cosine;

sine_cosine sine_cosine_of(double angle);
