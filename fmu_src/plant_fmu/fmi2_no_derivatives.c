/* FMI 2.0, directional derivatives: modelDescription.xml says that the simulated finger has none. */
#include "component.h"
#include "fmi2Functions.h"

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
  (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
  if (!component_may_call(instance, CALL_GET_DIRECTIONAL_DERIVATIVE)) {
    return fmi2Error;
  }
  return (fmi2Status)component_fail(instance, "fmi2GetDirectionalDerivative",
                                    "there are none: providesDirectionalDerivative is false");
}
