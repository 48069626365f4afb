/* What finger.c puts together: a sample as a recipe (step.c), its inputs and outputs (samples.c), its derivative
 * (directional_derivative.c), and all that is remembered as bytes (saved_state.c). */
#pragma once

#include "finger_memory.h"
#include "message.h"

/* Takes the sample whose inputs stand in scratch. Returns 0, or −1 where it overflows and nothing is remembered. */
int take_sample(tendonfmu_finger* finger, double time);

/* --- inputs and outputs ------------------------------------------------------------------------------------------- */

/* Checks the time and copies the inputs that the kinematics source uses into scratch. Returns 1; 0 where the sample at
 * this time is already taken; or −1 with one line in message. */
int samples_take_inputs(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs, message_line message);

/* Copies the outputs of the last sample into row `row` of the caller's arrays. */
void samples_give_outputs(const tendonfmu_finger* finger, const tendonfmu_outputs* wanted, size_t row);

/* Bytes of the caller's tendonfmu_outputs. */
size_t outputs_size(const tendonfmu_outputs* outputs);

/* Row `row` of many samples. */
tendonfmu_inputs samples_row(const tendonfmu_finger* finger, const tendonfmu_inputs* inputs, size_t row);

/* --- the derivative of the last sample ---------------------------------------------------------------------------- */

/* direction and derivative as in tendonfmu.h; the finger is initialised and nothing in it changes but scratch. */
void directional_derivative(tendonfmu_finger* finger, const tendonfmu_inputs* direction,
                            const tendonfmu_outputs* derivative);

/* --- saved states ------------------------------------------------------------------------------------------------- */

/* A finger's state as bytes.
 *
 *   offset  0  8 bytes  "TFMUSTA" and a zero
 *           8  u32      version = 4
 *          12  u32      0
 *          16  u64      size of the whole block
 *          24  u64      checksum of all that follows
 *          32  u64      checksum of the model image it belongs to
 *          40  f64[p]   parameter values
 *              f64[s]   everything remembered (finger_state), outputs included */
size_t saved_state_size(const tendonfmu_finger* finger);

/* bytes [saved_state_size] */
void save_state(const tendonfmu_finger* finger, void* bytes);

/* Takes over saved bytes, or refuses them, changes nothing, and returns −1 with one line in message. */
int restore_state(tendonfmu_finger* finger, const void* bytes, message_line message);
