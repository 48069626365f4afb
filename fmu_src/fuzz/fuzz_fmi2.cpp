// Sequences of FMI 2.0 calls: see call_sequence.hpp.
#include "call_sequence.hpp"
#include "fmi2Functions.h"

namespace {

void log(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String category, fmi2String message, ...) {
  calls::message_is_sound(category, message);
}

}  // namespace

namespace calls::version {

void* instantiate(const unpacked_fmu& fmu) {
  static const fmi2CallbackFunctions callbacks = {log, std::calloc, std::free, nullptr, nullptr};
  return fmi2Instantiate("fuzzed", fmi2CoSimulation, fmu.guid.c_str(), ("file://" + fmu.folder).c_str(), &callbacks,
                         fmi2False, fmi2True);
}
void free_instance(void* component) {
  fmi2FreeInstance(component);
}
VERSION_CALL(get_state, (void* component, void** state), fmi2GetFMUstate(component, state))
VERSION_CALL(set_state, (void* component, void* state), fmi2SetFMUstate(component, state))
VERSION_CALL(free_state, (void* component, void** state), fmi2FreeFMUstate(component, state))
VERSION_CALL(serialized_size, (void* component, void* state, std::size_t* size),
             fmi2SerializedFMUstateSize(component, state, size))
VERSION_CALL(serialize, (void* component, void* state, unsigned char* bytes, std::size_t size),
             fmi2SerializeFMUstate(component, state, reinterpret_cast<fmi2Byte*>(bytes), size))
VERSION_CALL(deserialize, (void* component, const unsigned char* bytes, std::size_t size, void** state),
             fmi2DeSerializeFMUstate(component, reinterpret_cast<const fmi2Byte*>(bytes), size, state))
VERSION_CALL(enter_initialisation, (void* component), fmi2EnterInitializationMode(component))
VERSION_CALL(exit_initialisation, (void* component), fmi2ExitInitializationMode(component))
VERSION_CALL(step, (void* component, double from, double over), fmi2DoStep(component, from, over, fmi2False))
VERSION_CALL(write, (void* component, const references& which, const std::vector<double>& numbers),
             fmi2SetReal(component, which.data(), which.size(), numbers.data()))

fmu_status read(void* component, variable_type type, const references& which, std::vector<double>& numbers) {
  if (type == VARIABLE_REAL) {
    return as_status(fmi2GetReal(component, which.data(), which.size(), numbers.data()));
  }
  std::vector<int> found(numbers.size());
  const auto get = type == VARIABLE_INTEGER ? fmi2GetInteger : fmi2GetBoolean;
  const fmu_status status = as_status(get(component, which.data(), which.size(), found.data()));
  std::copy(found.begin(), found.end(), numbers.begin());
  return status;
}

}  // namespace calls::version

namespace {

using calls::as_status;
using calls::variable_list;

class fmi2_sequence : public calls::call_sequence {
 public:
  using call_sequence::call_sequence;

 private:
  static answer answered(fmu_function function, fmi2Status status) { return {function, as_status(status)}; }

  answer one_call() override {
    switch (data_.ConsumeIntegralInRange(0, 19)) {
      case 0: return set_up();
      case 1:
        return moved<PHASE_INITIALISATION>(CALL_ENTER_INITIALIZATION_MODE, as_status(fmi2EnterInitializationMode(c())));
      case 2:
        return moved<PHASE_STEP_COMPLETE>(CALL_EXIT_INITIALIZATION_MODE, as_status(fmi2ExitInitializationMode(c())));
      case 3: return seldom() ? end() : step();
      case 4: return read();
      case 5: return read_anything();
      case 6: return write_anything();
      case 7: return keep();
      case 8: return take_back_kept();
      case 9: return take_back_damaged();
      case 10: return wrong_states();
      case 11: return derive();
      case 12: return status();
      case 13: return log_settings();
      case 14: return not_offered();
      case 15:
      case 16: return write(fmu_.inputs, 10.0);
      case 17: return write(fmu_.parameters, 0.1);
      case 18: return motion();
      default: return step();
    }
  }

  answer set_up() {
    return answered(CALL_SETUP_EXPERIMENT,
                    fmi2SetupExperiment(c(), data_.ConsumeBool(), number(), number(), data_.ConsumeBool(), number()));
  }

  answer end() {
    if (data_.ConsumeBool()) {
      return moved<PHASE_TERMINATED>(CALL_TERMINATE, as_status(fmi2Terminate(c())));
    }
    return reset(as_status(fmi2Reset(c())));
  }

  answer step() {
    const double from = point(), over = length();
    return {CALL_DO_STEP, stepped(from, over, as_status(fmi2DoStep(c(), from, over, data_.ConsumeBool())))};
  }

  answer write(const variable_list& list, double factor) {
    const variable_list some = some_of(list, 1, 5);
    const std::vector<double> values = numbers(some.references.size(), factor);
    return answered(CALL_SET_REAL, fmi2SetReal(c(), some.references.data(), values.size(), values.data()));
  }

  answer write_anything() {
    const calls::references vr = any_variables().references;
    const fmi2Integer whole[4] = {data_.ConsumeIntegral<fmi2Integer>(), 2, -1, 3};
    const fmi2Real real[4] = {number(), number(), 1.0, 0.0};
    const fmi2String text[4] = {"a", nullptr, "", "b"};
    switch (data_.ConsumeIntegralInRange(0, 3)) {
      case 0: return answered(CALL_SET_REAL, fmi2SetReal(c(), vr.data(), vr.size(), rarely_null(real)));
      case 1: return answered(CALL_SET_INTEGER, fmi2SetInteger(c(), vr.data(), vr.size(), rarely_null(whole)));
      case 2: return answered(CALL_SET_BOOLEAN, fmi2SetBoolean(c(), vr.data(), vr.size(), rarely_null(whole)));
      default: return answered(CALL_SET_STRING, fmi2SetString(c(), vr.data(), vr.size(), rarely_null(text)));
    }
  }

  answer read() {
    std::vector<double> values(fmu_.outputs.references.size());
    return answered(CALL_GET_REAL, fmi2GetReal(c(), fmu_.outputs.references.data(), values.size(), values.data()));
  }

  answer read_anything() {
    const calls::references vr = any_variables().references;
    fmi2Integer whole[4];
    fmi2Real real[4];
    fmi2String text[4];
    switch (data_.ConsumeIntegralInRange(0, 3)) {
      case 0: return answered(CALL_GET_REAL, fmi2GetReal(c(), vr.data(), vr.size(), rarely_null(real)));
      case 1: return answered(CALL_GET_INTEGER, fmi2GetInteger(c(), vr.data(), vr.size(), rarely_null(whole)));
      case 2: return answered(CALL_GET_BOOLEAN, fmi2GetBoolean(c(), vr.data(), vr.size(), rarely_null(whole)));
      default: return answered(CALL_GET_STRING, fmi2GetString(c(), vr.data(), vr.size(), rarely_null(text)));
    }
  }

  answer derive() {
    const calls::references known = data_.ConsumeBool() ? fmu_.inputs.references : any_variables().references;
    const calls::references unknown = data_.ConsumeBool() ? fmu_.smooth_outputs.references : any_variables().references;
    const std::vector<double> seed = numbers(known.size());
    std::vector<double> found(unknown.size(), NAN);
    return answered(CALL_GET_DIRECTIONAL_DERIVATIVE,
                    fmi2GetDirectionalDerivative(c(), unknown.data(), unknown.size(), known.data(), known.size(),
                                                 seed.data(), found.data()));
  }

  answer status() {
    const auto kind = static_cast<fmi2StatusKind>(data_.ConsumeIntegralInRange(0, 3));
    fmi2Status step;
    fmi2Real real;
    fmi2Integer whole;
    fmi2String text;
    switch (data_.ConsumeIntegralInRange(0, 5)) {
      case 0: return answered(CALL_GET_STATUS, fmi2GetStatus(c(), kind, rarely_null(&step)));
      case 1: return answered(CALL_GET_REAL_STATUS, fmi2GetRealStatus(c(), kind, rarely_null(&real)));
      case 2: return answered(CALL_GET_INTEGER_STATUS, fmi2GetIntegerStatus(c(), kind, rarely_null(&whole)));
      case 3: return answered(CALL_GET_BOOLEAN_STATUS, fmi2GetBooleanStatus(c(), kind, rarely_null(&whole)));
      case 4: return answered(CALL_GET_STRING_STATUS, fmi2GetStringStatus(c(), kind, rarely_null(&text)));
      default: return answered(CALL_CANCEL_STEP, fmi2CancelStep(c()));
    }
  }

  answer log_settings() {
    const fmi2String categories[] = {"logStatusError", "logEvents", "no such", nullptr};
    const std::size_t count = data_.ConsumeIntegralInRange<std::size_t>(0, 4);
    return answered(CALL_SET_DEBUG_LOGGING,
                    fmi2SetDebugLogging(c(), data_.ConsumeBool(), count, rarely_null(categories)));
  }

  // what this FMU says that it does not do
  answer not_offered() {
    const fmi2Integer order = 1;
    fmi2Real value = number();
    fmi2EventInfo info = {};
    fmi2ValueReference vr = data_.ConsumeIntegral<fmi2ValueReference>();
    switch (data_.ConsumeIntegralInRange(0, 6)) {
      case 0: return refused(as_status(fmi2SetRealInputDerivatives(c(), &vr, 1, &order, &value)));
      case 1: return refused(as_status(fmi2GetRealOutputDerivatives(c(), &vr, 1, &order, &value)));
      case 2: return refused(as_status(fmi2EnterEventMode(c())));
      case 3: return refused(as_status(fmi2NewDiscreteStates(c(), &info)));
      case 4: return refused(as_status(fmi2SetTime(c(), value)));
      case 5: return refused(as_status(fmi2GetDerivatives(c(), &value, 1)));
      default: return refused(as_status(fmi2SetContinuousStates(c(), &value, 1)));
    }
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  calls::run_sequence<fmi2_sequence>(bytes, size);
  return 0;
}
