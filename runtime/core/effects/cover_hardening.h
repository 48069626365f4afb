#ifndef TENDONFMU_COVER_HARDENING_H
#define TENDONFMU_COVER_HARDENING_H

#include "effect.h"

extern const effect_type effect_cover_hardening;

#endif
