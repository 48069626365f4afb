// One instance of the FMU, and what has to hold after each call whatever was called: see fuzz_fmi2.cpp.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "fmi2Functions.h"
#include "promises.h"

extern "C" {
#include "call_table.h"
#include "model.h"
#include "variable_table.h"
}

namespace fmi2 {

using promises::byte_list;
using references = std::vector<fmi2ValueReference>;

/* every message is one printable line */
inline void log(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String category, fmi2String message, ...) {
  PROMISE(category && *category && message && *message);
  for (const char* c = message; *c; ++c) {
    PROMISE(static_cast<unsigned char>(*c) >= 0x20);
  }
}

/* A model image in a folder of its own, as in an FMU, and the references of its variables. */
struct unpacked_fmu {
  std::string guid, location;
  references inputs, outputs, flags, whole, parameters;
  fmi2CallbackFunctions callbacks = {log, std::calloc, std::free, nullptr, nullptr};

  explicit unpacked_fmu(const byte_list& image) {
    std::string folder = (std::filesystem::temp_directory_path() / "fuzz_fmi2-XXXXXX").string();
    PROMISE(mkdtemp(folder.data()) != nullptr);
    std::ofstream(folder + "/" + model_text.resource, std::ios::binary)
        .write(reinterpret_cast<const char*>(image.data()), static_cast<std::streamsize>(image.size()));
    location = "file://" + folder;
    char text[39];
    model_guid(image.data(), image.size(), text);
    guid = text;
    find_variables();
  }

  fmi2Component instance() const {
    return fmi2Instantiate("fuzzed", fmi2CoSimulation, guid.c_str(), location.c_str(), &callbacks, fmi2False, fmi2True);
  }

 private:
  /* by asking for them */
  void find_variables() {
    const fmi2Component c = instance();
    PROMISE(c != nullptr);
    PROMISE(fmi2EnterInitializationMode(c) == fmi2OK);
    for (const variable_group& group : variable_groups) {
      for (fmi2ValueReference vr = group.base; is_there(c, group.type, vr) && vr < group.base + 64; ++vr) {
        list_of(group).push_back(vr);
        if (group.size == SIZE_SCALAR) {
          break;
        }
      }
    }
    for (fmi2ValueReference vr = VARIABLE_PARAMETER_BASE; is_there(c, VARIABLE_REAL, vr); ++vr) {
      parameters.push_back(vr);
    }
    fmi2FreeInstance(c);
  }

  references& list_of(const variable_group& group) {
    if (group.causality == CAUSALITY_INPUT) {
      return inputs;
    }
    return group.type == VARIABLE_BOOLEAN ? flags : group.type == VARIABLE_INTEGER ? whole : outputs;
  }

  static bool is_there(fmi2Component c, variable_type type, fmi2ValueReference vr) {
    fmi2Real real;
    fmi2Integer integer;
    switch (type) {
      case VARIABLE_REAL: return fmi2GetReal(c, &vr, 1, &real) == fmi2OK;
      case VARIABLE_INTEGER: return fmi2GetInteger(c, &vr, 1, &integer) == fmi2OK;
      default: return fmi2GetBoolean(c, &vr, 1, &integer) == fmi2OK;
    }
  }
};

/* An instance beside a model of the life cycle that the standard prescribes. */
class instance {
 public:
  explicit instance(const unpacked_fmu& fmu) : fmu_(fmu), component_(fmu.instance()) { PROMISE(component_ != nullptr); }
  ~instance() { fmi2FreeInstance(component_); }
  instance(const instance&) = delete;
  instance& operator=(const instance&) = delete;

  fmi2Component component() const { return component_; }
  const unpacked_fmu& fmu() const { return fmu_; }
  fmu_phase phase() const { return failed_ ? PHASE_ERROR : phase_; }
  double last_end = 0.0;  // of the last step that was carried out

  byte_list saved() const {
    fmi2FMUstate state = nullptr;
    std::size_t size = 0;
    PROMISE(fmi2GetFMUstate(component_, &state) == fmi2OK);
    PROMISE(fmi2SerializedFMUstateSize(component_, state, &size) == fmi2OK);
    byte_list bytes(size);
    PROMISE(fmi2SerializeFMUstate(component_, state, reinterpret_cast<fmi2Byte*>(bytes.data()), size) == fmi2OK);
    PROMISE(fmi2FreeFMUstate(component_, &state) == fmi2OK && state == nullptr);
    return bytes;
  }

  using change = void (*)(instance&);

  /* What has to hold after a call that answered `status`; `next` is what the call does to the life cycle, if anything;
   * `before` is what saved() gave before it, or nothing: saving takes longer than most calls. */
  void answered(fmu_function function, fmi2Status status, change next, const byte_list& before) {
    PROMISE(status == fmi2OK || status == fmi2Warning || status == fmi2Discard || status == fmi2Error);
    PROMISE(status == fmi2Error || call_is_allowed(function, phase()));
    if (status == fmi2Error) {
      failed_ = true;
      PROMISE(before.empty() || saved() == before);
    } else if (next) {
      next(*this);
    }
    if (phase_ == PHASE_STEP_COMPLETE || phase_ == PHASE_TERMINATED) {
      outputs_are_sound();
    }
  }
  void moved_to(fmu_phase phase) { phase_ = phase; }
  void left_error_to(fmu_phase phase) {
    phase_ = phase;
    failed_ = false;
  }
  fmu_phase phase_behind_error() const { return phase_; }

 private:
  void outputs_are_sound() const {
    std::vector<fmi2Real> numbers(fmu_.outputs.size());
    std::vector<fmi2Boolean> flags(fmu_.flags.size());
    PROMISE(fmi2GetReal(component_, fmu_.outputs.data(), numbers.size(), numbers.data()) == fmi2OK);
    PROMISE(fmi2GetBoolean(component_, fmu_.flags.data(), flags.size(), flags.data()) == fmi2OK);
    for (const double x : numbers) {
      PROMISE(std::isfinite(x));
    }
    for (const fmi2Boolean x : flags) {
      PROMISE(x == fmi2False || x == fmi2True);
    }
  }

  const unpacked_fmu& fmu_;
  fmi2Component component_;
  fmu_phase phase_ = PHASE_INSTANTIATED;
  bool failed_ = false;
};

}  // namespace fmi2
