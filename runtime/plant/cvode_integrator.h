/* CVODE (A. C. Hindmarsh et al., "SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers", ACM TOMS
 * 31(3), 2005): backward differentiation formulas of order 1 to 5 with the analytic Jacobian, kinks found as roots. */
#pragma once

#include <memory>

#include "integrator.h"

namespace tendonfmu::plant {

/* Throws std::bad_alloc when SUNDIALS runs out of memory. */
std::unique_ptr<integrator> make_cvode_integrator(dynamics* equations, double relative_tolerance);

}  // namespace tendonfmu::plant
