/* A finger's state as bytes.
 *
 *   offset  0  8 bytes  "TFMUSTA" and a zero
 *           8  u32      version = 1
 *          12  u32      0
 *          16  u64      size of the whole block
 *          24  u64      checksum of all that follows
 *          32  u64      checksum of the model image it belongs to
 *          40  f64[p]   parameter values
 *              f64[s]   everything remembered (finger_state), outputs included */
#pragma once

#include "finger_memory.h"
#include "message.h"

size_t saved_state_size(const tendonfmu_finger* finger);

/* bytes [saved_state_size] */
void save_state(const tendonfmu_finger* finger, void* bytes);

/* Takes over saved bytes, or refuses them, changes nothing, and returns −1 with one line in message. */
int restore_state(tendonfmu_finger* finger, const void* bytes, message_line message);
