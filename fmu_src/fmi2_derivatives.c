/* FMI 2.0, directional derivatives of the friction model. */
#include "derivatives.h"
#include "fmi2Functions.h"

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
  const partials p = {.unknowns = {vUnknown_ref, nUnknown},
                      .knowns = {vKnown_ref, nKnown},
                      .seed = dvKnown,
                      .sensitivity = dvUnknown,
                      .seed_count = nKnown,
                      .sensitivity_count = nUnknown};
  return (fmi2Status)derivatives_directional(instance, &p);
}
