// Functions of FMI 3.0 that this FMU refuses in every state: what it does not offer, and types that no variable has.
#pragma once

#include <fuzzer/FuzzedDataProvider.h>

#include "fmi3Functions.h"

extern "C" {
#include "call_table.h"
}

namespace calls {

/* Room for what such a call would read or write. */
struct spare_values {
  fmi3Float32 float32[4] = {};
  fmi3Float64 float64[4] = {};
  fmi3Int8 int8[4] = {};
  fmi3UInt8 uint8[4] = {};
  fmi3Int16 int16[4] = {};
  fmi3UInt16 uint16[4] = {};
  fmi3Int32 int32[4] = {};
  fmi3UInt32 uint32[4] = {};
  fmi3Int64 int64[4] = {};
  fmi3UInt64 uint64[4] = {}, uint64_too[4] = {};
  fmi3String string[4] = {"a", nullptr, "", "b"};
  fmi3Binary binary[4] = {};
  fmi3Boolean flag[4] = {};
  fmi3Clock clock[4] = {true, false, true, false};
  std::size_t size[4] = {}, size_too[4] = {};
  fmi3ValueReference reference[4] = {};
  fmi3IntervalQualifier qualifier[4] = {};
  fmi3DependencyKind kind[4] = {};
};

/* modes, steps and clocks that there are not */
inline fmi3Status call_not_offered(FuzzedDataProvider& data, fmi3Instance c) {
  spare_values s;
  const std::size_t n = data.ConsumeIntegralInRange<std::size_t>(0, 4);
  const fmi3ValueReference one = data.ConsumeIntegral<fmi3ValueReference>();
  const fmi3ValueReference* const vr = n ? &one : nullptr;
  const double x = data.ConsumeFloatingPoint<double>();
  switch (data.ConsumeIntegralInRange(0, 27)) {
    case 0: return fmi3EnterEventMode(c);
    case 1: return fmi3EnterStepMode(c);
    case 2: return fmi3EvaluateDiscreteStates(c);
    case 3: return fmi3UpdateDiscreteStates(c, s.flag, s.flag + 1, s.flag + 2, s.flag + 3, nullptr, s.float64);
    case 4: return fmi3EnterConfigurationMode(c);
    case 5: return fmi3ExitConfigurationMode(c);
    case 6: return fmi3GetNumberOfVariableDependencies(c, one, s.size);
    case 7: return fmi3GetVariableDependencies(c, one, s.size, s.reference, s.size_too, s.kind, n);
    case 8: return fmi3GetOutputDerivatives(c, vr, n, s.int32, s.float64, n);
    case 9: return fmi3GetIntervalDecimal(c, vr, n, s.float64, s.qualifier);
    case 10: return fmi3GetIntervalFraction(c, vr, n, s.uint64, s.uint64_too, s.qualifier);
    case 11: return fmi3GetShiftDecimal(c, vr, n, s.float64);
    case 12: return fmi3GetShiftFraction(c, vr, n, s.uint64, s.uint64_too);
    case 13: return fmi3SetIntervalDecimal(c, vr, n, s.float64);
    case 14: return fmi3SetIntervalFraction(c, vr, n, s.uint64, s.uint64_too);
    case 15: return fmi3SetShiftDecimal(c, vr, n, s.float64);
    case 16: return fmi3SetShiftFraction(c, vr, n, s.uint64, s.uint64_too);
    case 17: return fmi3ActivateModelPartition(c, one, x);
    case 18: return fmi3EnterContinuousTimeMode(c);
    case 19: return fmi3CompletedIntegratorStep(c, n > 0, s.flag, s.flag + 1);
    case 20: return fmi3SetTime(c, x);
    case 21: return fmi3SetContinuousStates(c, s.float64, n);
    case 22: return fmi3GetContinuousStateDerivatives(c, s.float64, n);
    case 23: return fmi3GetEventIndicators(c, s.float64, n);
    case 24: return fmi3GetContinuousStates(c, s.float64, n);
    case 25: return fmi3GetNominalsOfContinuousStates(c, s.float64, n);
    case 26: return fmi3GetNumberOfEventIndicators(c, n ? s.size : nullptr);
    default: return fmi3GetNumberOfContinuousStates(c, n ? s.size : nullptr);
  }
}

struct typed_answer {
  fmu_function function;
  fmi3Status status;
};

/* `n` references, at most 4; nothing is asked of nValues, since nothing is read or written */
inline typed_answer call_of_other_type(FuzzedDataProvider& data, fmi3Instance c, const fmi3ValueReference* vr,
                                       std::size_t n) {
  spare_values s;
  const std::size_t count = data.ConsumeIntegralInRange<std::size_t>(0, 4);
  switch (data.ConsumeIntegralInRange(0, 21)) {
    case 0: return {CALL_GET_FLOAT32, fmi3GetFloat32(c, vr, n, s.float32, count)};
    case 1: return {CALL_GET_INT8, fmi3GetInt8(c, vr, n, s.int8, count)};
    case 2: return {CALL_GET_UINT8, fmi3GetUInt8(c, vr, n, s.uint8, count)};
    case 3: return {CALL_GET_INT16, fmi3GetInt16(c, vr, n, s.int16, count)};
    case 4: return {CALL_GET_UINT16, fmi3GetUInt16(c, vr, n, s.uint16, count)};
    case 5: return {CALL_GET_UINT32, fmi3GetUInt32(c, vr, n, s.uint32, count)};
    case 6: return {CALL_GET_INT64, fmi3GetInt64(c, vr, n, s.int64, count)};
    case 7: return {CALL_GET_UINT64, fmi3GetUInt64(c, vr, n, s.uint64, count)};
    case 8: return {CALL_GET_STRING, fmi3GetString(c, vr, n, s.string, count)};
    case 9: return {CALL_GET_BINARY, fmi3GetBinary(c, vr, n, s.size, s.binary, count)};
    case 10: return {CALL_GET_CLOCK, fmi3GetClock(c, vr, n, s.clock)};
    case 11: return {CALL_SET_FLOAT32, fmi3SetFloat32(c, vr, n, s.float32, count)};
    case 12: return {CALL_SET_INT8, fmi3SetInt8(c, vr, n, s.int8, count)};
    case 13: return {CALL_SET_UINT8, fmi3SetUInt8(c, vr, n, s.uint8, count)};
    case 14: return {CALL_SET_INT16, fmi3SetInt16(c, vr, n, s.int16, count)};
    case 15: return {CALL_SET_UINT16, fmi3SetUInt16(c, vr, n, s.uint16, count)};
    case 16: return {CALL_SET_UINT32, fmi3SetUInt32(c, vr, n, s.uint32, count)};
    case 17: return {CALL_SET_INT64, fmi3SetInt64(c, vr, n, s.int64, count)};
    case 18: return {CALL_SET_UINT64, fmi3SetUInt64(c, vr, n, s.uint64, count)};
    case 19: return {CALL_SET_STRING, fmi3SetString(c, vr, n, s.string, count)};
    case 20: return {CALL_SET_BINARY, fmi3SetBinary(c, vr, n, s.size, s.binary, count)};
    default: return {CALL_SET_CLOCK, fmi3SetClock(c, vr, n, s.clock)};
  }
}

}  // namespace calls
