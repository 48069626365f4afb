/* FMI 3.0, what modelDescription.xml says this FMU does not do: events, clocks, structural parameters, derivatives by
 * time, dependencies of single elements, model exchange and scheduled execution. The functions exist, since some
 * importers need every symbol, and refuse by name. */
#include "component.h"
#include "fmi3Functions.h"

static const char no_event_mode[] = "there is no Event Mode: hasEventMode is false";
static const char no_clock[] = "there are no clocks";
static const char no_structure[] = "there are no structural parameters";
static const char no_elements[] =
    "dependencies are those of modelDescription.xml: providesPerElementDependencies is false";
static const char model_exchange[] = "belongs to model exchange, this FMU is for co-simulation";

static fmi3Status refuse(component* c, const char* function, const char* reason) {
  return c ? (fmi3Status)component_fail_because(c, function, reason) : fmi3Error;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
  return refuse(instance, "fmi3EnterEventMode", no_event_mode);
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
  return refuse(instance, "fmi3EnterStepMode", "leads out of the Event Mode, and there is none: hasEventMode is false");
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
  return refuse(instance, "fmi3EvaluateDiscreteStates", no_event_mode);
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean* discreteStatesNeedUpdate,
                                    fmi3Boolean* terminateSimulation, fmi3Boolean* nominalsOfContinuousStatesChanged,
                                    fmi3Boolean* valuesOfContinuousStatesChanged, fmi3Boolean* nextEventTimeDefined,
                                    fmi3Float64* nextEventTime) {
  (void)discreteStatesNeedUpdate, (void)terminateSimulation, (void)nominalsOfContinuousStatesChanged,
      (void)valuesOfContinuousStatesChanged, (void)nextEventTimeDefined, (void)nextEventTime;
  return refuse(instance, "fmi3UpdateDiscreteStates", no_event_mode);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
  return refuse(instance, "fmi3EnterConfigurationMode", no_structure);
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
  return refuse(instance, "fmi3ExitConfigurationMode", no_structure);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference,
                                               size_t* nDependencies) {
  (void)valueReference, (void)nDependencies;
  return refuse(instance, "fmi3GetNumberOfVariableDependencies", no_elements);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
                                       size_t nDependencies) {
  (void)dependent, (void)elementIndicesOfDependent, (void)independents, (void)elementIndicesOfIndependents,
      (void)dependencyKinds, (void)nDependencies;
  return refuse(instance, "fmi3GetVariableDependencies", no_elements);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues) {
  (void)valueReferences, (void)nValueReferences, (void)orders, (void)values, (void)nValues;
  return refuse(instance, "fmi3GetOutputDerivatives",
                "outputs have no derivatives by time: maxOutputDerivativeOrder is 0");
}

/* --- clocks ------------------------------------------------------------------------------------------------------- */

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
  (void)valueReferences, (void)nValueReferences, (void)intervals, (void)qualifiers;
  return refuse(instance, "fmi3GetIntervalDecimal", no_clock);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[]) {
  (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions, (void)qualifiers;
  return refuse(instance, "fmi3GetIntervalFraction", no_clock);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, fmi3Float64 shifts[]) {
  (void)valueReferences, (void)nValueReferences, (void)shifts;
  return refuse(instance, "fmi3GetShiftDecimal", no_clock);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[]) {
  (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
  return refuse(instance, "fmi3GetShiftFraction", no_clock);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, const fmi3Float64 intervals[]) {
  (void)valueReferences, (void)nValueReferences, (void)intervals;
  return refuse(instance, "fmi3SetIntervalDecimal", no_clock);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[]) {
  (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
  return refuse(instance, "fmi3SetIntervalFraction", no_clock);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, const fmi3Float64 shifts[]) {
  (void)valueReferences, (void)nValueReferences, (void)shifts;
  return refuse(instance, "fmi3SetShiftDecimal", no_clock);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
  (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
  return refuse(instance, "fmi3SetShiftFraction", no_clock);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime) {
  (void)clockReference, (void)activationTime;
  return refuse(instance, "fmi3ActivateModelPartition",
                "belongs to scheduled execution, this FMU is for co-simulation");
}

/* --- model exchange ----------------------------------------------------------------------------------------------- */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
  return refuse(instance, "fmi3EnterContinuousTimeMode", model_exchange);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean* enterEventMode, fmi3Boolean* terminateSimulation) {
  (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
  return refuse(instance, "fmi3CompletedIntegratorStep", model_exchange);
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
  (void)time;
  return refuse(instance, "fmi3SetTime", model_exchange);
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
  (void)continuousStates, (void)nContinuousStates;
  return refuse(instance, "fmi3SetContinuousStates", model_exchange);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                             size_t nContinuousStates) {
  (void)derivatives, (void)nContinuousStates;
  return refuse(instance, "fmi3GetContinuousStateDerivatives", model_exchange);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators) {
  (void)eventIndicators, (void)nEventIndicators;
  return refuse(instance, "fmi3GetEventIndicators", model_exchange);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates) {
  (void)continuousStates, (void)nContinuousStates;
  return refuse(instance, "fmi3GetContinuousStates", model_exchange);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates) {
  (void)nominals, (void)nContinuousStates;
  return refuse(instance, "fmi3GetNominalsOfContinuousStates", model_exchange);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t* nEventIndicators) {
  (void)nEventIndicators;
  return refuse(instance, "fmi3GetNumberOfEventIndicators", model_exchange);
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t* nContinuousStates) {
  (void)nContinuousStates;
  return refuse(instance, "fmi3GetNumberOfContinuousStates", model_exchange);
}
