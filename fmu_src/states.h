/* Saved states of an instance: get, set, free, and as bytes. A state that the importer holds is a block of life cycle,
 * inputs, parameters and the model's own saved state: little-endian, checksummed, without pointers, the same in both
 * versions of FMI, in the process and outside. */
#pragma once

#include "component.h"

/* What the states of an FMU have in common, and no others: of its identifier (GUID, instantiation token). */
uint64_t component_identity(const char* identifier);

/* *state NULL: a new block; otherwise into this one. */
fmu_status states_get(component* c, void** state);
fmu_status states_set(component* c, const void* state);
fmu_status states_free(component* c, void** state);
fmu_status states_serialized_size(component* c, const void* state, size_t* size);
fmu_status states_serialize(component* c, const void* state, void* bytes, size_t size);
fmu_status states_deserialize(component* c, const void* bytes, size_t size, void** state);
