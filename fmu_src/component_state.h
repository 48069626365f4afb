/* The whole state of an instance as bytes: life cycle, inputs, parameters, and the model's own saved state.
 * Little-endian, checksummed, without pointers: the same bytes serve in the process and outside. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "component.h"

/* What the states of an FMU have in common, and no others: of its identifier (GUID, instantiation token). */
uint64_t component_identity(const char* identifier);

/* Bytes of a state; the same for every instance of one FMU. */
size_t component_state_size(const component* c);

/* Writes the state into bytes [component_state_size()]. Logging and the state "error" are no part of it. */
void component_save(const component* c, void* bytes);

/* Why a block that component_save() of some instance wrote is no state of this FMU, NULL when it is. Reads its first
 * bytes only, which every FMU of this kind writes. */
const char* component_refuse_block(const component* c, const void* bytes);

/* Why these bytes [size] cannot be a state of this FMU, NULL when they can. Changes nothing. */
const char* component_check_state(component* c, const void* bytes, size_t size);

/* Takes over a state; an instance in the state "error" leaves it. Returns NULL, or with nothing changed the reason. */
const char* component_restore(component* c, const void* bytes);
