/* FMI 3.0, partial derivatives of the friction model. */
#include "derivatives.h"
#include "fmi3Functions.h"

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
  const partials p = {{unknowns, nUnknowns}, {knowns, nKnowns}, seed, sensitivity, nSeed, nSensitivity};
  return (fmi3Status)derivatives_directional(instance, &p);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
  const partials p = {{unknowns, nUnknowns}, {knowns, nKnowns}, seed, sensitivity, nSeed, nSensitivity};
  return (fmi3Status)derivatives_adjoint(instance, &p);
}
