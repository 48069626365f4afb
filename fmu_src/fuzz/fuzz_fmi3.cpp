// Sequences of FMI 3.0 calls: see call_sequence.hpp. fmi3_refused.hpp has those that this FMU refuses always.
#include <memory>

#include "call_sequence.hpp"
#include "fmi3_refused.hpp"

namespace {

int environment; /* what messages come back with */

void log(fmi3InstanceEnvironment sender, fmi3Status status, fmi3String category, fmi3String message) {
  PROMISE(sender == &environment);
  PROMISE(status >= fmi3OK && status <= fmi3Error);
  calls::message_is_sound(category, message);
}

/* there are no intermediate values, so nobody is to be told of one */
void update(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean*,
            fmi3Float64*) {
  PROMISE(!"an intermediate update");
}

}  // namespace

namespace calls::version {

void* instantiate(const unpacked_fmu& fmu) {
  return fmi3InstantiateCoSimulation("fuzzed", fmu.guid.c_str(), (fmu.folder + "/").c_str(), false, true, false, true,
                                     nullptr, 0, &environment, log, update);
}
void free_instance(void* component) {
  fmi3FreeInstance(component);
}
VERSION_CALL(get_state, (void* component, void** state), fmi3GetFMUState(component, state))
VERSION_CALL(set_state, (void* component, void* state), fmi3SetFMUState(component, state))
VERSION_CALL(free_state, (void* component, void** state), fmi3FreeFMUState(component, state))
VERSION_CALL(serialized_size, (void* component, void* state, std::size_t* size),
             fmi3SerializedFMUStateSize(component, state, size))
VERSION_CALL(serialize, (void* component, void* state, unsigned char* bytes, std::size_t size),
             fmi3SerializeFMUState(component, state, bytes, size))
VERSION_CALL(deserialize, (void* component, const unsigned char* bytes, std::size_t size, void** state),
             fmi3DeserializeFMUState(component, bytes, size, state))
VERSION_CALL(enter_initialisation, (void* component),
             fmi3EnterInitializationMode(component, false, 0.0, 0.0, false, 0.0))
VERSION_CALL(exit_initialisation, (void* component), fmi3ExitInitializationMode(component))
VERSION_CALL(step, (void* component, double from, double over),
             fmi3DoStep(component, from, over, false, nullptr, nullptr, nullptr, nullptr))
VERSION_CALL(write, (void* component, const references& which, const std::vector<double>& numbers),
             fmi3SetFloat64(component, which.data(), which.size(), numbers.data(), numbers.size()))

template <class T, class Function>
fmu_status read_as(Function get, void* component, const references& which, std::vector<double>& numbers) {
  const auto found = std::make_unique<T[]>(numbers.size());
  const fmi3Status status = get(component, which.data(), which.size(), found.get(), numbers.size());
  std::copy_n(found.get(), numbers.size(), numbers.begin());
  return as_status(status);
}

fmu_status read(void* component, variable_type type, const references& which, std::vector<double>& numbers) {
  switch (type) {
    case VARIABLE_REAL: return read_as<fmi3Float64>(fmi3GetFloat64, component, which, numbers);
    case VARIABLE_INTEGER: return read_as<fmi3Int32>(fmi3GetInt32, component, which, numbers);
    default: return read_as<fmi3Boolean>(fmi3GetBoolean, component, which, numbers);
  }
}

}  // namespace calls::version

namespace {

using calls::as_status;
using calls::references;
using calls::variable_list;

class fmi3_sequence : public calls::call_sequence {
 public:
  using call_sequence::call_sequence;

 private:
  answer one_call() override {
    switch (data_.ConsumeIntegralInRange(0, 23)) {
      case 0: return enter_initialisation();
      case 1:
        return moved<PHASE_STEP_COMPLETE>(CALL_EXIT_INITIALIZATION_MODE, as_status(fmi3ExitInitializationMode(c())));
      case 2:
      case 3: return motion();
      case 4: return seldom() ? end() : step();
      case 5: return read();
      case 6: return read_anything();
      case 7: return write_anything();
      case 8: return other_type();
      case 9: return keep();
      case 10: return take_back_kept();
      case 11: return take_back_damaged();
      case 12: return wrong_states();
      case 13: return derive(CALL_GET_DIRECTIONAL_DERIVATIVE);
      case 14: return derive(CALL_GET_ADJOINT_DERIVATIVE);
      case 15: return log_settings();
      case 16: return refused(as_status(calls::call_not_offered(data_, c())));
      case 17: return instantiate_otherwise();
      case 18:
      case 19: return write(fmu_.inputs, 10.0);
      case 20: return write(fmu_.parameters, 0.1);
      default: return step();
    }
  }

  // --- life cycle ---

  answer enter_initialisation() {
    const double tolerance = number(), start = rarely() ? number() : 0.0, stop = number();
    const fmi3Status status = fmi3EnterInitializationMode(c(), data_.ConsumeBool(), tolerance, start, rarely(), stop);
    if (status == fmi3OK) {
      tried_.last_end = start;
    }
    return moved<PHASE_INITIALISATION>(CALL_ENTER_INITIALIZATION_MODE, as_status(status));
  }

  answer end() {
    if (data_.ConsumeBool()) {
      return moved<PHASE_TERMINATED>(CALL_TERMINATE, as_status(fmi3Terminate(c())));
    }
    return reset(as_status(fmi3Reset(c())));
  }

  /* whatever comes of the step, there is no event, no early return and no wish to end */
  answer step() {
    const double from = point(), over = length();
    bool event = true, terminate = true, early = true;
    double reached = NAN;
    const bool asks = !rarely();
    const fmi3Status status =
        fmi3DoStep(c(), from, over, data_.ConsumeBool(), asks ? &event : nullptr, asks ? &terminate : nullptr,
                   asks ? &early : nullptr, asks ? &reached : nullptr);
    PROMISE(!asks || (!event && !terminate && !early));
    PROMISE(!asks || status != fmi3OK || reached == from + over);
    PROMISE(!asks || !c() || std::isfinite(reached));
    return {CALL_DO_STEP, stepped(from, over, as_status(status))};
  }

  answer log_settings() {
    const fmi3String categories[] = {"logStatusError", "logEvents", "no such", nullptr};
    const std::size_t count = data_.ConsumeIntegralInRange<std::size_t>(0, 4);
    return {CALL_SET_DEBUG_LOGGING,
            as_status(fmi3SetDebugLogging(c(), data_.ConsumeBool(), count, rarely_null(categories)))};
  }

  /* other instances, wanted in ways that this FMU may refuse, change nothing of this one */
  answer instantiate_otherwise() {
    const std::string folder = fmu_.folder + (data_.ConsumeBool() ? "/" : "/none/");
    const fmi3ValueReference intermediate = data_.ConsumeIntegral<fmi3ValueReference>();
    const char* const token = rarely_null(fmu_.guid.c_str());
    const char* const name = rarely_null("another");
    const bool visible = data_.ConsumeBool(), logs = data_.ConsumeBool(), events = rarely();
    const std::size_t count = rarely() ? 1 : 0;
    fmi3Instance made = nullptr;
    switch (data_.ConsumeIntegralInRange(0, 7)) {
      case 0: made = fmi3InstantiateModelExchange(name, token, folder.c_str(), visible, logs, &environment, log); break;
      case 1:
        made = fmi3InstantiateScheduledExecution(name, token, folder.c_str(), visible, logs, &environment, log, nullptr,
                                                 nullptr, nullptr);
        break;
      default:
        made = fmi3InstantiateCoSimulation(name, token, rarely_null(folder.c_str()), visible, logs, events,
                                           data_.ConsumeBool(), rarely_null(&intermediate), count, &environment,
                                           rarely_null(log), rarely_null(update));
        PROMISE(!made || (token && !events && !count));
        fmi3FreeInstance(made);
        return {CALL_GET_FMU_STATE, c() ? FMU_OK : FMU_ERROR};
    }
    PROMISE(made == nullptr);
    return {CALL_GET_FMU_STATE, c() ? FMU_OK : FMU_ERROR};
  }

  // --- variables ---

  /* numbers that variables have together; rarely another count, which is to be refused */
  std::size_t count_for(const variable_list& list) {
    return rarely() ? data_.ConsumeIntegralInRange<std::size_t>(0, 40) : list.element_count();
  }

  answer write(const variable_list& list, double factor) {
    const variable_list some = some_of(list, 1, 4);
    const references& vr = some.references;
    const std::vector<double> values = numbers(some.element_count(), factor);
    return {CALL_SET_REAL, as_status(fmi3SetFloat64(c(), vr.data(), vr.size(), values.data(), values.size()))};
  }

  answer read() {
    std::vector<double> values(fmu_.outputs.element_count());
    const references& vr = fmu_.outputs.references;
    return {CALL_GET_REAL, as_status(fmi3GetFloat64(c(), vr.data(), vr.size(), values.data(), values.size()))};
  }

  /* `make` gives one value; what is written is as long as it is said to be */
  template <class T, class Function, class Make>
  answer set_as(fmu_function function, Function set, Make make) {
    const variable_list some = any_variables();
    const std::size_t count = count_for(some);
    const auto values = std::make_unique<T[]>(count);
    std::generate_n(values.get(), count, make);
    const references& vr = some.references;
    const fmi3Status status = set(c(), rarely_null(vr.data()), vr.size(), rarely_null(values.get()), count);
    PROMISE(status != fmi3OK || count == some.element_count());
    return {function, as_status(status)};
  }

  answer write_anything() {
    switch (data_.ConsumeIntegralInRange(0, 3)) {
      case 0: return set_as<fmi3Int32>(CALL_SET_INTEGER, fmi3SetInt32, [this] { return some_int(); });
      case 1: return set_as<fmi3Boolean>(CALL_SET_BOOLEAN, fmi3SetBoolean, [this] { return data_.ConsumeBool(); });
      default: return set_as<fmi3Float64>(CALL_SET_REAL, fmi3SetFloat64, [this] { return number(); });
    }
  }

  fmi3Int32 some_int() { return rarely() ? data_.ConsumeIntegral<fmi3Int32>() : data_.ConsumeIntegralInRange(-1, 4); }

  /* numbers that are read are finite, whatever was written, but for inputs */
  template <class T, class Function>
  answer get_as(fmu_function function, Function get) {
    const variable_list some = any_variables();
    const std::size_t count = count_for(some);
    const auto values = std::make_unique<T[]>(count);
    const references& vr = some.references;
    const fmi3Status status = get(c(), rarely_null(vr.data()), vr.size(), rarely_null(values.get()), count);
    PROMISE(status != fmi3OK || count == some.element_count());
    const bool has_inputs = std::any_of(vr.begin(), vr.end(), [this](unsigned one) {
      return std::count(fmu_.inputs.references.begin(), fmu_.inputs.references.end(), one) > 0;
    });
    PROMISE(status != fmi3OK || has_inputs ||
            std::all_of(values.get(), values.get() + count, [](double x) { return std::isfinite(x); }));
    return {function, as_status(status)};
  }

  answer read_anything() {
    switch (data_.ConsumeIntegralInRange(0, 3)) {
      case 0: return get_as<fmi3Int32>(CALL_GET_INTEGER, fmi3GetInt32);
      case 1: return get_as<fmi3Boolean>(CALL_GET_BOOLEAN, fmi3GetBoolean);
      default: return get_as<fmi3Float64>(CALL_GET_REAL, fmi3GetFloat64);
    }
  }

  /* refused unless no variable is named */
  answer other_type() {
    const references vr = any_variables().references;
    const auto [function, status] = calls::call_of_other_type(data_, c(), rarely_null(vr.data()), vr.size());
    PROMISE(vr.empty() || status == fmi3Error);
    return {function, as_status(status)};
  }

  // --- derivatives ---

  answer derive(fmu_function function) {
    const bool directional = function == CALL_GET_DIRECTIONAL_DERIVATIVE;
    const variable_list known = derived_by(fmu_.inputs), unknown = derived_by(fmu_.smooth_outputs);
    const std::vector<double> seed = numbers(count_for(directional ? known : unknown));
    std::vector<double> found(count_for(directional ? unknown : known), NAN);
    const auto get = directional ? fmi3GetDirectionalDerivative : fmi3GetAdjointDerivative;
    const fmi3Status status =
        get(c(), rarely_null(unknown.references.data()), unknown.references.size(), known.references.data(),
            known.references.size(), rarely_null(seed.data()), seed.size(), rarely_null(found.data()), found.size());
    PROMISE(status != fmi3OK || seed.size() == (directional ? known : unknown).element_count());
    PROMISE(status != fmi3OK || found.size() == (directional ? unknown : known).element_count());
    return {function, as_status(status)};
  }

  /* some of those that have derivatives, or of all kinds */
  variable_list derived_by(const variable_list& list) { return rarely() ? any_variables() : some_of(list, 0, 3); }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  calls::run_sequence<fmi3_sequence>(bytes, size);
  return 0;
}
