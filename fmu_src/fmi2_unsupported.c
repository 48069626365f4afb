/* FMI 2.0, what modelDescription.xml says this FMU does not do: derivatives of signals by time, and model exchange. The
 * functions exist, since some importers need every symbol, and refuse by name. */
#include "component.h"
#include "fmi2Functions.h"

fmi2Status fmi2SetRealInputDerivatives(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  (void)vr, (void)nvr, (void)order, (void)value;
  if (!component_may_call(instance, CALL_SET_REAL_INPUT_DERIVATIVES)) {
    return fmi2Error;
  }
  return (fmi2Status)component_fail_because(instance, "fmi2SetRealInputDerivatives",
                                            "inputs are not interpolated: canInterpolateInputs is false");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
  (void)vr, (void)nvr, (void)order, (void)value;
  if (!component_may_call(instance, CALL_GET_REAL_OUTPUT_DERIVATIVES)) {
    return fmi2Error;
  }
  return (fmi2Status)component_fail_because(instance, "fmi2GetRealOutputDerivatives",
                                            "outputs have no derivatives by time: maxOutputDerivativeOrder is 0");
}

/* --- model exchange ----------------------------------------------------------------------------------------------- */

static fmi2Status refuse(component* c, const char* function) {
  return c ? (fmi2Status)component_fail_because(c, function, "belongs to model exchange, this FMU is for co-simulation")
           : fmi2Error;
}

fmi2Status fmi2EnterEventMode(fmi2Component instance) {
  return refuse(instance, "fmi2EnterEventMode");
}

fmi2Status fmi2NewDiscreteStates(fmi2Component instance, fmi2EventInfo* eventInfo) {
  (void)eventInfo;
  return refuse(instance, "fmi2NewDiscreteStates");
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component instance) {
  return refuse(instance, "fmi2EnterContinuousTimeMode");
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component instance, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean* enterEventMode, fmi2Boolean* terminateSimulation) {
  (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
  return refuse(instance, "fmi2CompletedIntegratorStep");
}

fmi2Status fmi2SetTime(fmi2Component instance, fmi2Real time) {
  (void)time;
  return refuse(instance, "fmi2SetTime");
}

fmi2Status fmi2SetContinuousStates(fmi2Component instance, const fmi2Real x[], size_t nx) {
  (void)x, (void)nx;
  return refuse(instance, "fmi2SetContinuousStates");
}

fmi2Status fmi2GetDerivatives(fmi2Component instance, fmi2Real derivatives[], size_t nx) {
  (void)derivatives, (void)nx;
  return refuse(instance, "fmi2GetDerivatives");
}

fmi2Status fmi2GetEventIndicators(fmi2Component instance, fmi2Real eventIndicators[], size_t ni) {
  (void)eventIndicators, (void)ni;
  return refuse(instance, "fmi2GetEventIndicators");
}

fmi2Status fmi2GetContinuousStates(fmi2Component instance, fmi2Real x[], size_t nx) {
  (void)x, (void)nx;
  return refuse(instance, "fmi2GetContinuousStates");
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component instance, fmi2Real x_nominal[], size_t nx) {
  (void)x_nominal, (void)nx;
  return refuse(instance, "fmi2GetNominalsOfContinuousStates");
}
