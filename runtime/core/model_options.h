/* The option bits of the model image: which parts of a description are there. The bits of keys stand in
 * description/keys.json by their names. */
#pragma once

enum {
  MODEL_HAS_INITIAL_VARIANCE = 1,
  MODEL_HAS_INITIAL_TORQUE = 2,
  MODEL_HAS_NOISE_TIME = 4,
  MODEL_HAS_SENSOR_FAULT = 8,
  MODEL_FORGETS_BY_ABSORPTION = 16,
  MODEL_DETECTS_BY_BANDS = 32,
  MODEL_WATCHES_MOTORS = 64, /* beside the bit before */
  MODEL_HAS_DEVIATION = 128,
  MODEL_HAS_LINKS = 256,
  MODEL_HAS_TENDON_ZERO = 512, /* of any tendon; then every one has it */
  MODEL_OPTION_BITS = 1023
};
