/* The core's own headers, which are C alone, from C++. */
#pragma once

/* what the core includes of the C library: its names never come to stand in extern "C" */
#include <cfloat>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

extern "C" {
#include "bytes.h"
#include "contact_place.h"
#include "derived_numbers.h"
#include "effect.h"
#include "extensions.h"
#include "finger_memory.h"
#include "friction_law.h"
#include "link_geometry.h"
#include "message.h"
#include "model_image.h"
#include "parameters.h"
#include "pseudo_inverse.h"
#include "sensor_fault.h"
#include "slot_view.h"
}
