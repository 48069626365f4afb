/* SUNDIALS 6 and 7 differ in a few names. */
#pragma once

#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>
#include <sundials/sundials_types.h>

#if SUNDIALS_VERSION_MAJOR < 6
#error "the simulated finger needs SUNDIALS 6 or 7"
#endif

namespace tendonfmu::plant {

#if SUNDIALS_VERSION_MAJOR >= 7
using solver_number = sunrealtype;
using solver_flag = sunbooleantype;
inline int create_context(SUNContext* context) {
  return SUNContext_Create(SUN_COMM_NULL, context);
}
#else
using solver_number = realtype;
using solver_flag = booleantype;
inline int create_context(SUNContext* context) {
  return SUNContext_Create(nullptr, context);
}
#endif

}  // namespace tendonfmu::plant
