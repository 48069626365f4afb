// A byte string drives a sequence of calls on one instance. Whatever is called, in whatever state and with whatever
// arguments: a call that is refused, a step that is discarded and a call that only asks leave no trace in the saved
// state, one that the standard does not allow is refused, messages are one line, and outputs are finite (fuzzed_fmu.hpp
// holds what is checked). Here is what the sequences of all versions of FMI have in common: arguments and saved states.
#pragma once

#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <cmath>

#include <deque>

#include "fuzzed_fmu.hpp"
#include "fuzzed_models.hpp"

extern "C" {
#include "bytes.h"
}

namespace calls {

/* a saved state of the core, inside that of the FMU */
inline std::ptrdiff_t place_of_core(const byte_list& bytes) {
  const byte_list magic = {'T', 'F', 'M', 'U', 'S', 'T', 'A', 0};
  return std::search(bytes.begin() + 40, bytes.end(), magic.begin(), magic.end()) - bytes.begin();
}

/* but for the checksums, and the sign of zeros */
inline bool is_same_state(const byte_list& a, const byte_list& b) {
  const std::ptrdiff_t checksum_of_core = place_of_core(a) + 24;
  for (std::size_t i = 32; i + 8 <= a.size(); i += 8) {
    const bool zeros = load_f64(&a[i]) == 0.0 && load_f64(&b[i]) == 0.0;
    if (load_u64(&a[i]) != load_u64(&b[i]) && !zeros && static_cast<std::ptrdiff_t>(i) != checksum_of_core) {
      return false;
    }
  }
  return a.size() == b.size();
}

class call_sequence {
 public:
  call_sequence(FuzzedDataProvider& data, const unpacked_fmu& fmu, const unpacked_fmu& other)
      : data_(data), fmu_(fmu), tried_(fmu), other_(other) {
    begin(data_.ConsumeIntegralInRange(0, 7));
  }
  virtual ~call_sequence() = default;

  void call() {
    if (tried_.phase() == PHASE_ERROR && data_.ConsumeIntegralInRange(0, 3)) {
      go_back();
    }
    const int kind = data_.ConsumeIntegralInRange(0, 63);
    next_ = nothing;
    without_instance_ = kind == 1;
    const byte_list before = kind % 4 ? byte_list() : tried_.saved();
    const auto [function, status] = one_call();
    if (without_instance_) {
      PROMISE(status == FMU_ERROR);
    } else {
      tried_.answered(function, status, next_, before);
    }
  }

 protected:
  struct answer {
    fmu_function function;
    fmu_status status;
  };
  static constexpr instance::change nothing = nullptr;

  virtual answer one_call() = 0;

  void* c() const { return without_instance_ ? nullptr : tried_.component(); }

  // --- arguments ---

  bool seldom() { return data_.ConsumeIntegralInRange(0, 3) == 0; }
  bool rarely() { return data_.ConsumeIntegralInRange(0, 15) == 0; }

  template <class T>
  T* rarely_null(T* pointer) {
    return rarely() ? nullptr : pointer;
  }

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

  std::vector<double> numbers(std::size_t count, double factor = 1.0) {
    std::vector<double> all(count);
    for (double& x : all) {
      x = number() * factor;
    }
    return all;
  }

  /* some of a list, with repetitions */
  variable_list some_of(const variable_list& list, std::size_t least, std::size_t most) {
    variable_list some;
    for (std::size_t i = data_.ConsumeIntegralInRange(least, most); i > 0; --i) {
      const std::size_t at = data_.ConsumeIntegralInRange<std::size_t>(0, list.references.size() - 1);
      some.add(list.references[at], list.elements[at]);
    }
    return some;
  }

  /* of any kinds, and some that are none */
  variable_list any_variables() {
    const variable_list* const lists[] = {&fmu_.inputs, &fmu_.outputs,    &fmu_.flags,
                                          &fmu_.whole,  &fmu_.parameters, &fmu_.time};
    variable_list some;
    for (int i = data_.ConsumeIntegralInRange(0, 4); i > 0; --i) {
      const variable_list& list = *data_.PickValueInArray(lists);
      if (rarely() || list.references.empty()) {
        some.add(data_.ConsumeIntegral<unsigned>(), 1);
      } else {
        const variable_list one = some_of(list, 1, 1);
        some.add(one.references[0], one.elements[0]);
      }
    }
    return some;
  }

  /* where the next step begins, and how long it is; mostly so that it can be carried out */
  double point() { return rarely() ? number() : tried_.last_end; }
  double length() {
    const double wanted = rarely() ? number() : 0.001 + 0.01 * std::abs(number());
    return wanted <= 1e3 ? std::min(wanted, longest_step) : wanted;
  }

  // --- life cycle ---

  /* Some 1 to 20 samples of a motion with sensible numbers, as far as they are carried out. */
  answer motion() {
    without_instance_ = false;
    const double rate = 10.0 * number(), size = 10.0 * number(), shift = number();
    std::vector<double> values(fmu_.inputs.element_count());
    for (int k = data_.ConsumeIntegralInRange(1, 20); k > 0 && tried_.phase() == PHASE_STEP_COMPLETE; --k) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = size * std::sin(rate * tried_.last_end + shift * static_cast<double>(i * i));
      }
      tried_.answered(CALL_SET_REAL, version::write(c(), fmu_.inputs.references, values), nothing, {});
      const double from = tried_.last_end, over = std::min(0.01, longest_step / 20.0);
      tried_.answered(CALL_DO_STEP, stepped(from, over, version::step(c(), from, over)), nothing, {});
    }
    return {CALL_SET_FMU_STATE, FMU_OK}; /* allowed in every state; all is checked by now */
  }

  fmu_status stepped(double point, double length, fmu_status status) {
    if (status == FMU_OK) {
      PROMISE(std::isfinite(point) && std::isfinite(length) && length > 0.0);
      tried_.last_end = point + length;
    }
    return status;
  }

  template <fmu_phase phase>
  static void move(instance& i) {
    i.moved_to(phase);
  }
  template <fmu_phase phase>
  answer moved(fmu_function function, fmu_status status) {
    next_ = move<phase>;
    return {function, status};
  }

  answer reset(fmu_status status) {
    next_ = [](instance& i) { i.left_error_to(PHASE_INSTANTIATED); };
    return {CALL_RESET, status};
  }

  /* allowed in every state by the table, and refused all the same */
  static answer refused(fmu_status status) {
    PROMISE(status == FMU_ERROR);
    return {CALL_RESET, status};
  }

  // --- saved states, always of an instance ---

  answer keep() {
    without_instance_ = false;
    kept_ = tried_.saved();
    kept_phase_ = tried_.phase_behind_error();
    return {CALL_GET_FMU_STATE, FMU_OK};
  }

  answer take_back_kept() { return take_back(kept_, true); }
  answer take_back_damaged() { return take_back(damaged(), false); }

  // blocks and bytes of another FMU, no block at all, and sizes that do not fit
  answer wrong_states() {
    without_instance_ = false;
    instance other(other_);
    void *state = nullptr, *own = nullptr;
    PROMISE(version::get_state(other.component(), &state) == FMU_OK);
    PROMISE(version::get_state(c(), &own) == FMU_OK);
    const byte_list bytes = other.saved(), bytes_of_own = tried_.saved();
    PROMISE(refused_state(state, own, bytes, bytes_of_own.size()) == FMU_ERROR);
    PROMISE(other.saved() == bytes);
    version::free_state(other.component(), &state);
    PROMISE(version::free_state(c(), &own) == FMU_OK);
    return {CALL_SET_FMU_STATE, FMU_ERROR};
  }

  FuzzedDataProvider& data_;
  const unpacked_fmu& fmu_;
  instance tried_;

 private:
  /* mostly in Step Mode, since calls that are refused keep a sequence from getting there */
  void begin(int how_far) {
    if (how_far > 0) {
      const fmu_status entered = version::enter_initialisation(c());
      PROMISE(entered == FMU_OK);
      tried_.answered(CALL_ENTER_INITIALIZATION_MODE, entered, move<PHASE_INITIALISATION>, {});
    }
    if (how_far > 1) {
      const fmu_status left = version::exit_initialisation(c());
      PROMISE(left == FMU_OK);
      tried_.answered(CALL_EXIT_INITIALIZATION_MODE, left, move<PHASE_STEP_COMPLETE>, {});
    }
    keep();
  }

  /* to the state kept last, whatever was refused */
  void go_back() {
    const auto [function, status] = take_back_kept();
    PROMISE(status == FMU_OK);
    tried_.answered(function, status, nothing, {});
  }

  fmu_status refused_state(void* state, void* own, const byte_list& bytes, std::size_t size) {
    const std::size_t wrong_size = size + (data_.ConsumeBool() ? 1 : -1) * data_.ConsumeIntegralInRange(1, 40);
    byte_list room(std::max(wrong_size, bytes.size()));
    std::size_t found = 0;
    void* none = nullptr;
    switch (data_.ConsumeIntegralInRange(0, 13)) {
      case 0: return version::set_state(c(), state);
      case 1: return version::get_state(c(), &state);
      case 2: return version::serialized_size(c(), state, &found);
      case 3: return version::serialize(c(), state, room.data(), bytes.size());
      case 4: return version::set_state(c(), nullptr);
      case 5: return version::deserialize(c(), bytes.data(), bytes.size(), &state);
      case 6: return version::get_state(c(), nullptr);
      case 7: return version::serialized_size(c(), own, nullptr);
      case 8: return version::serialized_size(c(), nullptr, &found);
      case 9: return version::serialize(c(), own, room.data(), wrong_size);
      case 10: return version::serialize(c(), data_.ConsumeBool() ? own : nullptr, nullptr, size);
      case 11: return version::deserialize(c(), nullptr, size, &own);
      case 12: return version::deserialize(c(), room.data(), wrong_size, &none);
      default: return version::deserialize(c(), room.data(), size <= room.size() ? size : 0, nullptr);
    }
  }

  // A saved state, with some bytes changed, half the time under a checksum that fits: that of the FMU alone, or the
  // core's inside it as well.
  byte_list damaged() {
    byte_list bytes = kept_;
    for (int i = data_.ConsumeIntegralInRange(1, 4); i > 0; --i) {
      if (data_.ConsumeBool()) {
        bytes[data_.ConsumeIntegralInRange<std::size_t>(0, bytes.size() - 1)] = data_.ConsumeIntegral<unsigned char>();
      } else {
        store_f64(&bytes[8 * data_.ConsumeIntegralInRange<std::size_t>(5, bytes.size() / 8 - 1)], number());
      }
    }
    if (data_.ConsumeBool()) {
      const auto at = static_cast<std::size_t>(place_of_core(bytes));
      if (at + 40 < bytes.size()) {
        store_u64(&bytes[at + 24], hash_bytes(&bytes[at + 32], bytes.size() - at - 32, 0));
      }
      store_u64(&bytes[24], hash_bytes(&bytes[32], bytes.size() - 32, 0));  // as states.c has it
    }
    if (rarely()) {
      bytes.resize(data_.ConsumeIntegralInRange<std::size_t>(0, bytes.size() + 8));
    }
    return bytes;
  }

  answer take_back(const byte_list& bytes, bool whole) {
    without_instance_ = false;
    void* state = nullptr;
    const fmu_status read = version::deserialize(c(), bytes.data(), bytes.size(), &state);
    PROMISE((read == FMU_OK) == (state != nullptr));
    PROMISE(!whole || read == FMU_OK);
    const fmu_status status = read == FMU_OK ? version::set_state(c(), state) : read;
    if (status == FMU_OK) {
      PROMISE(is_same_state(tried_.saved(), bytes));
      tried_.left_error_to(static_cast<fmu_phase>(static_cast<int>(load_f64(&bytes[40]))));
      tried_.last_end = load_f64(&bytes[40 + 8 * 4]);
      PROMISE(!whole || tried_.phase() == kept_phase_);
    }
    PROMISE(version::free_state(c(), &state) == FMU_OK);
    return {CALL_SET_FMU_STATE, status};
  }

  const unpacked_fmu& other_;
  bool without_instance_ = false; /* the call is made with NULL in place of the instance */
  byte_list kept_;
  fmu_phase kept_phase_ = PHASE_INSTANTIATED;
  instance::change next_ = nothing; /* what a call does to the life cycle when it is carried out */
};

/* The sequence that the bytes of a fuzzer stand for, on one of three FMUs. */
template <class Sequence>
void run_sequence(const std::uint8_t* bytes, std::size_t size) {
  static const std::vector<byte_list> made_of = resources();
  static const std::deque<unpacked_fmu> fmus = [] {
    std::deque<unpacked_fmu> all;
    for (const byte_list& resource : made_of) {
      all.emplace_back(resource, all.size() % 2 == 1);  // the second takes samples at the end of steps
    }
    return all;
  }();
  FuzzedDataProvider data(bytes, size);
  const std::size_t which = data.ConsumeIntegralInRange<std::size_t>(0, 7);
  Sequence sequence(data, fmus[which < 6 ? 0 : which - 5], fmus[which < 6 ? 1 : 0]);
  while (data.remaining_bytes() > 0) {
    sequence.call();
  }
}

}  // namespace calls
