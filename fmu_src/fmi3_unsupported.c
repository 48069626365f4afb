/* FMI 3.0, what modelDescription.xml says this FMU does not do: events, clocks, structural parameters, derivatives by
 * time, dependencies of single elements, model exchange and scheduled execution. The functions exist, since some
 * importers want every symbol, and refuse by name. */
#include "component.h"
#include "fmi3Functions.h"
#include "refused_call.h"

static const char no_event_mode[] = "there is no Event Mode: hasEventMode is false";
static const char no_step_mode[] = "leads out of the Event Mode, and there is none: hasEventMode is false";
static const char no_clock[] = "there are no clocks";
static const char no_structure[] = "there are no structural parameters";
static const char no_elements[] =
    "dependencies are those of modelDescription.xml: providesPerElementDependencies is false";
static const char no_output_derivatives[] = "outputs have no derivatives by time: maxOutputDerivativeOrder is 0";
static const char scheduled_execution[] = "belongs to scheduled execution, this FMU is for co-simulation";
static const char model_exchange[] = "belongs to model exchange, this FMU is for co-simulation";

REFUSE(fmi3Status, fmi3EnterEventMode, no_event_mode, (fmi3Instance instance))
REFUSE(fmi3Status, fmi3EnterStepMode, no_step_mode, (fmi3Instance instance))
REFUSE(fmi3Status, fmi3EvaluateDiscreteStates, no_event_mode, (fmi3Instance instance))
REFUSE(fmi3Status, fmi3UpdateDiscreteStates, no_event_mode,
       (fmi3Instance instance, fmi3Boolean* discreteStatesNeedUpdate, fmi3Boolean* terminateSimulation,
        fmi3Boolean* nominalsOfContinuousStatesChanged, fmi3Boolean* valuesOfContinuousStatesChanged,
        fmi3Boolean* nextEventTimeDefined, fmi3Float64* nextEventTime))
REFUSE(fmi3Status, fmi3EnterConfigurationMode, no_structure, (fmi3Instance instance))
REFUSE(fmi3Status, fmi3ExitConfigurationMode, no_structure, (fmi3Instance instance))
REFUSE(fmi3Status, fmi3GetNumberOfVariableDependencies, no_elements,
       (fmi3Instance instance, fmi3ValueReference valueReference, size_t* nDependencies))
REFUSE(fmi3Status, fmi3GetVariableDependencies, no_elements,
       (fmi3Instance instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
        fmi3ValueReference independents[], size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
        size_t nDependencies))
REFUSE(fmi3Status, fmi3GetOutputDerivatives, no_output_derivatives,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues))
/* clocks */
REFUSE(fmi3Status, fmi3GetIntervalDecimal, no_clock,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]))
REFUSE(fmi3Status, fmi3GetIntervalFraction, no_clock,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]))
REFUSE(fmi3Status, fmi3GetShiftDecimal, no_clock,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        fmi3Float64 shifts[]))
REFUSE(fmi3Status, fmi3GetShiftFraction, no_clock,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        fmi3UInt64 counters[], fmi3UInt64 resolutions[]))
REFUSE(fmi3Status, fmi3SetIntervalDecimal, no_clock,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const fmi3Float64 intervals[]))
REFUSE(fmi3Status, fmi3SetIntervalFraction, no_clock,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))
REFUSE(fmi3Status, fmi3SetShiftDecimal, no_clock,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const fmi3Float64 shifts[]))
REFUSE(fmi3Status, fmi3SetShiftFraction, no_clock,
       (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
        const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))
REFUSE(fmi3Status, fmi3ActivateModelPartition, scheduled_execution,
       (fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime))
/* model exchange */
REFUSE(fmi3Status, fmi3EnterContinuousTimeMode, model_exchange, (fmi3Instance instance))
REFUSE(fmi3Status, fmi3CompletedIntegratorStep, model_exchange,
       (fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean* enterEventMode,
        fmi3Boolean* terminateSimulation))
REFUSE(fmi3Status, fmi3SetTime, model_exchange, (fmi3Instance instance, fmi3Float64 time))
REFUSE(fmi3Status, fmi3SetContinuousStates, model_exchange,
       (fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates))
REFUSE(fmi3Status, fmi3GetContinuousStateDerivatives, model_exchange,
       (fmi3Instance instance, fmi3Float64 derivatives[], size_t nContinuousStates))
REFUSE(fmi3Status, fmi3GetEventIndicators, model_exchange,
       (fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators))
REFUSE(fmi3Status, fmi3GetContinuousStates, model_exchange,
       (fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates))
REFUSE(fmi3Status, fmi3GetNominalsOfContinuousStates, model_exchange,
       (fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates))
REFUSE(fmi3Status, fmi3GetNumberOfEventIndicators, model_exchange, (fmi3Instance instance, size_t* nEventIndicators))
REFUSE(fmi3Status, fmi3GetNumberOfContinuousStates, model_exchange, (fmi3Instance instance, size_t* nContinuousStates))
