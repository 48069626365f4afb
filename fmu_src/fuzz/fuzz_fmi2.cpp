// A byte string drives a sequence of FMI 2.0 calls on one instance. Whatever is called, in whatever state and with
// whatever arguments: a call that is refused leaves no trace in the saved state, one that the standard does not allow
// is refused, messages are one line, and outputs are finite. fmi2_session.hpp holds what is checked; a wrapper of
// another version of FMI gets a file like this one.
#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <cmath>

#include "../tests/test_finger.h"
#include "fmi2_session.hpp"

extern "C" {
#include "bytes.h"
}

namespace {

using promises::byte_list;

/* as component_state.c has it: FNV-1a of all after the header */
std::uint64_t checksum(const byte_list& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (std::size_t i = 32; i < bytes.size(); ++i) {
    hash = (hash ^ bytes[i]) * 0x100000001b3u;
  }
  return hash;
}

/* but for the checksums, and the sign of zeros */
bool is_same_state(const byte_list& a, const byte_list& b) {
  const byte_list core = {'T', 'F', 'M', 'U', 'S', 'T', 'A', 0};
  const auto checksum_of_core = std::search(a.begin() + 40, a.end(), core.begin(), core.end()) - a.begin() + 24;
  for (std::size_t i = 32; i + 8 <= a.size(); i += 8) {
    const bool zeros = load_f64(&a[i]) == 0.0 && load_f64(&b[i]) == 0.0;
    if (load_u64(&a[i]) != load_u64(&b[i]) && !zeros && static_cast<std::ptrdiff_t>(i) != checksum_of_core) {
      return false;
    }
  }
  return a.size() == b.size();
}

class call_session {
 public:
  call_session(FuzzedDataProvider& data, const fmi2::unpacked_fmu& fmu, const fmi2::unpacked_fmu& other)
      : data_(data), fmu_(fmu), tried_(fmu), other_(other) {}

  void call() {
    next_ = nothing;
    const byte_list before = data_.ConsumeIntegralInRange(0, 3) ? byte_list() : tried_.saved();
    const auto [function, status] = one_call();
    tried_.answered(function, status, next_, before);
  }

 private:
  struct answer {
    fmu_function function;
    fmi2Status status;
  };
  static constexpr fmi2::instance::change nothing = nullptr;
  fmi2Component c() const { return tried_.component(); }

  answer one_call() {
    switch (data_.ConsumeIntegralInRange(0, 19)) {
      case 0: return set_up();
      case 1:
        next_ = [](fmi2::instance& i) { i.moved_to(PHASE_INITIALISATION); };
        return {CALL_ENTER_INITIALIZATION_MODE, fmi2EnterInitializationMode(c())};
      case 2:
        next_ = [](fmi2::instance& i) { i.moved_to(PHASE_STEP_COMPLETE); };
        return {CALL_EXIT_INITIALIZATION_MODE, fmi2ExitInitializationMode(c())};
      case 3: return rarely() ? end() : step();
      case 4: return read();
      case 5: return read_anything();
      case 6: return write_anything();
      case 7: return keep();
      case 8: return take_back(kept());
      case 9: return take_back(damaged());
      case 10: return states_of_others();
      case 11: return derive();
      case 12: return status();
      case 13: return log_settings();
      case 14: return not_offered();
      case 15:
      case 16: return write(fmu_.inputs);
      case 17: return write(fmu_.parameters);
      default: return step();
    }
  }

  // --- arguments ---

  bool rarely() { return data_.ConsumeIntegralInRange(0, 15) == 0; }

  double number() {
    const double odd[] = {0.0,  -0.0, 5e-324, -1e-300, 1.0,   1e9,      1e12,      -1e12, 1.1e12,
                          1e13, 1e15, 1e16,   1e300,   1e308, HUGE_VAL, -HUGE_VAL, NAN};
    switch (data_.ConsumeIntegralInRange(0, 7)) {
      case 0: return data_.PickValueInArray(odd);
      case 1: return data_.ConsumeFloatingPoint<double>();
      case 2: return data_.ConsumeFloatingPointInRange(-1e3, 1e3);
      default: return data_.ConsumeFloatingPointInRange(-1.0, 1.0);
    }
  }

  fmi2ValueReference any_reference() {
    const fmi2::references* const lists[] = {&fmu_.inputs, &fmu_.outputs, &fmu_.flags, &fmu_.whole, &fmu_.parameters};
    const fmi2::references& list = *data_.PickValueInArray(lists);
    return rarely() || list.empty() ? data_.ConsumeIntegral<fmi2ValueReference>()
                                    : list[data_.ConsumeIntegralInRange<std::size_t>(0, list.size() - 1)];
  }

  fmi2::references some_references() {
    fmi2::references some(data_.ConsumeIntegralInRange<std::size_t>(0, 4));
    for (fmi2ValueReference& vr : some) {
      vr = any_reference();
    }
    return some;
  }

  // --- calls ---

  answer set_up() {
    return {CALL_SETUP_EXPERIMENT,
            fmi2SetupExperiment(c(), data_.ConsumeBool(), number(), number(), data_.ConsumeBool(), number())};
  }

  answer end() {
    if (data_.ConsumeBool()) {
      next_ = [](fmi2::instance& i) { i.moved_to(PHASE_TERMINATED); };
      return {CALL_TERMINATE, fmi2Terminate(c())};
    }
    next_ = [](fmi2::instance& i) { i.left_error_to(PHASE_INSTANTIATED); };
    return {CALL_RESET, fmi2Reset(c())};
  }

  answer step() {
    const double length = rarely() ? number() : 0.001 + 0.01 * std::abs(number());
    const double point = rarely() ? number() : tried_.last_end;
    const fmi2Status status = fmi2DoStep(c(), point, length, data_.ConsumeBool());
    if (status == fmi2OK) {
      PROMISE(std::isfinite(point) && std::isfinite(length) && length > 0.0);
      tried_.last_end = point + length;
    }
    return {CALL_DO_STEP, status};
  }

  answer write(const fmi2::references& list) {
    const std::size_t count = data_.ConsumeIntegralInRange<std::size_t>(1, 5);
    fmi2::references vr(count);
    std::vector<double> values(count);
    for (std::size_t i = 0; i < count; ++i) {
      vr[i] = list[data_.ConsumeIntegralInRange<std::size_t>(0, list.size() - 1)];
      values[i] = number() * (&list == &fmu_.inputs ? 10.0 : 0.1);
    }
    return {CALL_SET_REAL, fmi2SetReal(c(), vr.data(), count, values.data())};
  }

  answer write_anything() {
    const fmi2::references vr = some_references();
    const fmi2Integer whole[4] = {data_.ConsumeIntegral<fmi2Integer>(), 2, -1, 3};
    const fmi2Real real[4] = {number(), number(), 1.0, 0.0};
    const fmi2String text[4] = {"a", nullptr, "", "b"};
    const bool null = rarely();
    switch (data_.ConsumeIntegralInRange(0, 3)) {
      case 0: return {CALL_SET_REAL, fmi2SetReal(c(), vr.data(), vr.size(), null ? nullptr : real)};
      case 1: return {CALL_SET_INTEGER, fmi2SetInteger(c(), vr.data(), vr.size(), null ? nullptr : whole)};
      case 2: return {CALL_SET_BOOLEAN, fmi2SetBoolean(c(), vr.data(), vr.size(), null ? nullptr : whole)};
      default: return {CALL_SET_STRING, fmi2SetString(c(), vr.data(), vr.size(), null ? nullptr : text)};
    }
  }

  answer read() {
    std::vector<double> values(fmu_.outputs.size());
    return {CALL_GET_REAL, fmi2GetReal(c(), fmu_.outputs.data(), values.size(), values.data())};
  }

  answer read_anything() {
    const fmi2::references vr = some_references();
    fmi2Integer whole[4];
    fmi2Real real[4];
    fmi2String text[4];
    const bool null = rarely();
    switch (data_.ConsumeIntegralInRange(0, 3)) {
      case 0: return {CALL_GET_REAL, fmi2GetReal(c(), vr.data(), vr.size(), null ? nullptr : real)};
      case 1: return {CALL_GET_INTEGER, fmi2GetInteger(c(), vr.data(), vr.size(), null ? nullptr : whole)};
      case 2: return {CALL_GET_BOOLEAN, fmi2GetBoolean(c(), vr.data(), vr.size(), null ? nullptr : whole)};
      default: return {CALL_GET_STRING, fmi2GetString(c(), vr.data(), vr.size(), null ? nullptr : text)};
    }
  }

  answer keep() {
    kept_ = tried_.saved();
    kept_phase_ = tried_.phase_behind_error();
    return {CALL_GET_FMU_STATE, fmi2OK};
  }

  /* the present state where none was kept before */
  const byte_list& kept() {
    if (kept_.empty()) {
      keep();
    }
    return kept_;
  }

  // A saved state, with some bytes changed, half the time under a checksum that fits: that of the FMU alone, or the
  // core's inside it as well.
  byte_list damaged() {
    byte_list bytes = kept();
    for (int i = data_.ConsumeIntegralInRange(1, 4); i > 0; --i) {
      if (data_.ConsumeBool()) {
        bytes[data_.ConsumeIntegralInRange<std::size_t>(0, bytes.size() - 1)] = data_.ConsumeIntegral<unsigned char>();
      } else {
        store_f64(&bytes[8 * data_.ConsumeIntegralInRange<std::size_t>(5, bytes.size() / 8 - 1)], number());
      }
    }
    if (data_.ConsumeBool()) {
      const byte_list core = {'T', 'F', 'M', 'U', 'S', 'T', 'A', 0};
      const auto at = std::search(bytes.begin() + 40, bytes.end(), core.begin(), core.end());
      if (at != bytes.end() && bytes.end() - at > 40) {
        store_u64(&at[24], hash_bytes(&at[32], static_cast<std::size_t>(bytes.end() - at) - 32, 0));
      }
      store_u64(&bytes[24], checksum(bytes));
    }
    if (rarely()) {
      bytes.resize(data_.ConsumeIntegralInRange<std::size_t>(0, bytes.size() + 8));
    }
    return bytes;
  }

  answer take_back(const byte_list& bytes) {
    const bool whole = &bytes == &kept_;
    fmi2FMUstate state = nullptr;
    const fmi2Status read =
        fmi2DeSerializeFMUstate(c(), reinterpret_cast<const fmi2Byte*>(bytes.data()), bytes.size(), &state);
    PROMISE((read == fmi2OK) == (state != nullptr));
    PROMISE(!whole || read == fmi2OK);
    const fmi2Status status = read == fmi2OK ? fmi2SetFMUstate(c(), state) : read;
    if (status == fmi2OK) {
      PROMISE(is_same_state(tried_.saved(), bytes));
      tried_.left_error_to(static_cast<fmu_phase>(static_cast<int>(load_f64(&bytes[40]))));
      tried_.last_end = load_f64(&bytes[40 + 8 * 4]);
      PROMISE(!whole || tried_.phase() == kept_phase_);
    }
    PROMISE(fmi2FreeFMUstate(c(), &state) == fmi2OK);
    return {CALL_SET_FMU_STATE, status};
  }

  // blocks and bytes of another FMU, and no block at all
  answer states_of_others() {
    fmi2::instance other(other_);
    fmi2FMUstate state = nullptr;
    PROMISE(fmi2GetFMUstate(other.component(), &state) == fmi2OK);
    const byte_list bytes = other.saved();
    byte_list room(bytes.size());
    std::size_t size = 0;
    answer found = {CALL_SET_FMU_STATE, fmi2OK};
    switch (data_.ConsumeIntegralInRange(0, 5)) {
      case 0: found.status = fmi2SetFMUstate(c(), state); break;
      case 1: found.status = fmi2GetFMUstate(c(), &state); break;
      case 2: found.status = fmi2SerializedFMUstateSize(c(), state, &size); break;
      case 3:
        found.status = fmi2SerializeFMUstate(c(), state, reinterpret_cast<fmi2Byte*>(room.data()), room.size());
        break;
      case 4: found.status = fmi2SetFMUstate(c(), nullptr); break;
      default:
        found.status =
            fmi2DeSerializeFMUstate(c(), reinterpret_cast<const fmi2Byte*>(bytes.data()), bytes.size(), &state);
    }
    PROMISE(found.status == fmi2Error);
    PROMISE(other.saved() == bytes);
    fmi2FreeFMUstate(other.component(), &state);
    return found;
  }

  answer derive() {
    const fmi2::references known = data_.ConsumeBool() ? fmu_.inputs : some_references();
    const fmi2::references unknown = data_.ConsumeBool() ? fmu_.outputs : some_references();
    std::vector<double> seed(known.size()), found(unknown.size(), NAN);
    for (double& x : seed) {
      x = number();
    }
    const fmi2Status status = fmi2GetDirectionalDerivative(c(), unknown.data(), unknown.size(), known.data(),
                                                           known.size(), seed.data(), found.data());
    return {CALL_GET_DIRECTIONAL_DERIVATIVE, status};
  }

  answer status() {
    const auto kind = static_cast<fmi2StatusKind>(data_.ConsumeIntegralInRange(0, 3));
    fmi2Status step;
    fmi2Real real;
    fmi2Integer whole;
    fmi2String text;
    const bool null = rarely();
    switch (data_.ConsumeIntegralInRange(0, 5)) {
      case 0: return {CALL_GET_STATUS, fmi2GetStatus(c(), kind, null ? nullptr : &step)};
      case 1: return {CALL_GET_REAL_STATUS, fmi2GetRealStatus(c(), kind, null ? nullptr : &real)};
      case 2: return {CALL_GET_INTEGER_STATUS, fmi2GetIntegerStatus(c(), kind, null ? nullptr : &whole)};
      case 3: return {CALL_GET_BOOLEAN_STATUS, fmi2GetBooleanStatus(c(), kind, null ? nullptr : &whole)};
      case 4: return {CALL_GET_STRING_STATUS, fmi2GetStringStatus(c(), kind, null ? nullptr : &text)};
      default: return {CALL_CANCEL_STEP, fmi2CancelStep(c())};
    }
  }

  answer log_settings() {
    const fmi2String categories[] = {"logStatusError", "logEvents", "no such", nullptr};
    const std::size_t count = data_.ConsumeIntegralInRange<std::size_t>(0, 4);
    return {CALL_SET_DEBUG_LOGGING,
            fmi2SetDebugLogging(c(), data_.ConsumeBool(), count, rarely() ? nullptr : categories)};
  }

  // what this FMU says that it does not do
  answer not_offered() {
    const fmi2Integer order = 1;
    fmi2Real value = number();
    fmi2EventInfo info = {};
    fmi2ValueReference vr = any_reference();
    answer found = {CALL_RESET, fmi2OK}; /* allowed in every state: refused all the same */
    switch (data_.ConsumeIntegralInRange(0, 6)) {
      case 0: found.status = fmi2SetRealInputDerivatives(c(), &vr, 1, &order, &value); break;
      case 1: found.status = fmi2GetRealOutputDerivatives(c(), &vr, 1, &order, &value); break;
      case 2: found.status = fmi2EnterEventMode(c()); break;
      case 3: found.status = fmi2NewDiscreteStates(c(), &info); break;
      case 4: found.status = fmi2SetTime(c(), value); break;
      case 5: found.status = fmi2GetDerivatives(c(), &value, 1); break;
      default: found.status = fmi2SetContinuousStates(c(), &value, 1);
    }
    PROMISE(found.status == fmi2Error);
    return found;
  }

  FuzzedDataProvider& data_;
  const fmi2::unpacked_fmu& fmu_;
  fmi2::instance tried_;
  const fmi2::unpacked_fmu& other_;
  byte_list kept_;
  fmu_phase kept_phase_ = PHASE_INSTANTIATED;
  fmi2::instance::change next_ = nothing; /* what a call does to the life cycle when it is carried out */
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  static const fmi2::unpacked_fmu fmus[] = {fmi2::unpacked_fmu(test_finger::image()),
                                            fmi2::unpacked_fmu(test_finger::image(test_finger::watched_sensors())),
                                            fmi2::unpacked_fmu(test_finger::image(test_finger::every_effect()))};
  FuzzedDataProvider data(bytes, size);
  const std::size_t which = data.ConsumeIntegralInRange<std::size_t>(0, 7);
  call_session session(data, fmus[which < 6 ? 0 : which - 5], fmus[which < 6 ? 1 : 0]);
  while (data.remaining_bytes() > 0) {
    session.call();
  }
  return 0;
}
