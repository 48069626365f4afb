/* The core's own headers, from C++. */
#ifndef TENDONFMU_CORE_INSIDE_H
#define TENDONFMU_CORE_INSIDE_H

#include <cstddef>
#include <cstdint>

extern "C" {
#include "effect.h"
#include "message.h"
#include "model_image.h"
#include "parameters.h"
}

#endif
