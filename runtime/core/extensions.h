/* The effects beyond the paper that a finger carries: their torques, their memory. */
#ifndef TENDONFMU_EXTENSIONS_H
#define TENDONFMU_EXTENSIONS_H

#include "finger_memory.h"

/* Adds the torque of every extension to T of its joint, in scratch. */
void add_extension_torques(tendonfmu_finger* finger);

/* Brings the memory of every extension up to the sample in scratch. */
void remember_extensions(tendonfmu_finger* finger);

/* One extension at the sample last remembered. */
effect_torque extension_torque(const tendonfmu_finger* finger, size_t extension, size_t* joint);

#endif
