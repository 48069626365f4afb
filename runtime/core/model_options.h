/* The option bits of the model image: which parts of a description are there. The bits of keys stand in
 * description/keys.json by their names. */
#pragma once

enum {
  MODEL_HAS_INITIAL_VARIANCE = 1,
  MODEL_HAS_INITIAL_TORQUE = 2,
  MODEL_HAS_NOISE_TIME = 4,
  MODEL_HAS_SENSOR_FAULT = 8,
  MODEL_FORGETS_BY_ABSORPTION = 16,
  MODEL_BOUNDS_PRESLIDING = 32,     /* beside MODEL_HAS_FRICTION_BOUND */
  MODEL_DETECTS_BY_INNOVATION = 64, /* methods "innovation" and "cusum" */
  MODEL_DETECTS_BY_CUSUM = 128,     /* beside the bit before */
  MODEL_HAS_FRICTION_BOUND = 256,
  MODEL_HAS_UNCERTAINTY = 512,
  MODEL_UNCERTAINTY_DIRECTIONS = 7 << 10, /* three bits: the largest number of directions of a joint, 0..4 */
  MODEL_HAS_DEVIATION = 1 << 13,
  MODEL_HAS_RELEASE = 1 << 14,
  MODEL_HAS_RELEASE_TIME = 1 << 15,
  MODEL_HAS_LINKS = 1 << 16,
  MODEL_HAS_TENDON_ZERO = 1 << 17, /* of any tendon; then every one has it */
  MODEL_HAS_REST = 1 << 18,
  MODEL_HAS_REST_INNOVATION = 1 << 19, /* beside the bit before */
  MODEL_HAS_START_SHARE = 1 << 20,
  MODEL_HAS_DRIFT = 1 << 21,
  MODEL_OPTION_BITS = (1 << 22) - 1
};
