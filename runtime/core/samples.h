/* Samples from the caller's arrays into the finger, and outputs back. */
#pragma once

#include "finger_memory.h"
#include "message.h"

/* Checks the time and copies the inputs that the kinematics source uses into scratch; their values are left to the
 * kernel. Returns 0, or −1 with one line in message. */
int samples_take_inputs(tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs, message_line message);

/* Says in message which input is out of range, after the kernel refused them. */
void samples_name_bad_input(const tendonfmu_finger* finger, double time, const tendonfmu_inputs* inputs,
                            message_line message);

/* Copies the outputs of the last sample into row `row` of the caller's arrays. */
void samples_give_outputs(const tendonfmu_finger* finger, const tendonfmu_outputs* wanted, size_t row);

/* Bytes of the caller's tendonfmu_outputs. */
size_t outputs_size(const tendonfmu_outputs* outputs);

/* Row `row` of many samples. */
tendonfmu_inputs samples_row(const tendonfmu_finger* finger, const tendonfmu_inputs* inputs, size_t row);
