/* FMI 2.0, what modelDescription.xml says this FMU does not do: derivatives of signals by time, and model exchange. The
 * functions exist, since some importers need every symbol, and refuse by name. */
#include "component.h"
#include "fmi2Functions.h"
#include "refused_call.h"

static const char not_interpolated[] = "inputs are not interpolated: canInterpolateInputs is false";
static const char no_output_derivatives[] = "outputs have no derivatives by time: maxOutputDerivativeOrder is 0";
static const char model_exchange[] = "belongs to model exchange, this FMU is for co-simulation";

static fmi2Status refuse(component* c, fmu_function function, const char* reason) {
  return component_may_call(c, function) ? (fmi2Status)component_fail(c, call_name(function), "%s", reason) : fmi2Error;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  return refuse(instance, CALL_SET_REAL_INPUT_DERIVATIVES, not_interpolated);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
  return refuse(instance, CALL_GET_REAL_OUTPUT_DERIVATIVES, no_output_derivatives);
}

REFUSE(fmi2Status, fmi2EnterEventMode, model_exchange, (fmi2Component instance))
REFUSE(fmi2Status, fmi2NewDiscreteStates, model_exchange, (fmi2Component instance, fmi2EventInfo* eventInfo))
REFUSE(fmi2Status, fmi2EnterContinuousTimeMode, model_exchange, (fmi2Component instance))
REFUSE(fmi2Status, fmi2CompletedIntegratorStep, model_exchange,
       (fmi2Component instance, fmi2Boolean noSetFMUStatePriorToCurrentPoint, fmi2Boolean* enterEventMode,
        fmi2Boolean* terminateSimulation))
REFUSE(fmi2Status, fmi2SetTime, model_exchange, (fmi2Component instance, fmi2Real time))
REFUSE(fmi2Status, fmi2SetContinuousStates, model_exchange, (fmi2Component instance, const fmi2Real x[], size_t nx))
REFUSE(fmi2Status, fmi2GetDerivatives, model_exchange, (fmi2Component instance, fmi2Real derivatives[], size_t nx))
REFUSE(fmi2Status, fmi2GetEventIndicators, model_exchange,
       (fmi2Component instance, fmi2Real eventIndicators[], size_t ni))
REFUSE(fmi2Status, fmi2GetContinuousStates, model_exchange, (fmi2Component instance, fmi2Real x[], size_t nx))
REFUSE(fmi2Status, fmi2GetNominalsOfContinuousStates, model_exchange,
       (fmi2Component instance, fmi2Real x_nominal[], size_t nx))
