// An FMU, an instance of it, and what has to hold after each call whatever was called, in any version of FMI.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "promises.h"

extern "C" {
#include "call_table.h"
#include "component.h"
#include "model.h"
#include "variable_table.h"
}

namespace calls {

using promises::byte_list;
using references = std::vector<unsigned>;

/* Variables of one kind, and how many numbers each has: one for each, but for the arrays of FMI 3.0. */
struct variable_list {
  calls::references references;
  std::vector<std::size_t> elements;

  std::size_t element_count() const {
    std::size_t sum = 0;
    for (const std::size_t count : elements) {
      sum += count;
    }
    return sum;
  }
  void add(unsigned reference, std::size_t count) {
    references.push_back(reference);
    elements.push_back(count);
  }
};

class unpacked_fmu;

template <class Status>
fmu_status as_status(Status status) {
  return static_cast<fmu_status>(status);
}

// Calls that both versions have, under one name. fuzz_fmi2.cpp and fuzz_fmi3.cpp define them.
#define VERSION_CALL(name, parameters, call) \
  fmu_status name parameters {               \
    return as_status(call);                  \
  }
namespace version {
void* instantiate(const unpacked_fmu& fmu);
void free_instance(void* component);
fmu_status get_state(void* component, void** state);
fmu_status set_state(void* component, void* state);
fmu_status free_state(void* component, void** state);
fmu_status serialized_size(void* component, void* state, std::size_t* size);
fmu_status serialize(void* component, void* state, unsigned char* bytes, std::size_t size);
fmu_status deserialize(void* component, const unsigned char* bytes, std::size_t size, void** state);
/* from time 0, without an end */
fmu_status enter_initialisation(void* component);
fmu_status exit_initialisation(void* component);
/* numbers of the variables, Booleans as 0 and 1 */
fmu_status read(void* component, variable_type type, const references& which, std::vector<double>& numbers);
fmu_status write(void* component, const references& which, const std::vector<double>& numbers);
fmu_status step(void* component, double from, double over);
}  // namespace version

/* every message is one printable line */
inline void message_is_sound(const char* category, const char* message) {
  PROMISE(category && *category && message && *message);
  for (const char* c = message; *c; ++c) {
    PROMISE(static_cast<unsigned char>(*c) >= 0x20);
  }
}

/* what it changes of an instance is not part of its state */
inline bool only_asks(fmu_function function) {
  return std::string(call_name(function)).find("Get") == 4 || function == CALL_SET_DEBUG_LOGGING;
}

/* A model image in a folder of its own, as in an FMU, and its variables. */
class unpacked_fmu {
 public:
  std::string guid, folder;
  variable_list inputs, outputs, smooth_outputs, flags, whole, parameters, time;

  unpacked_fmu(const byte_list& image, bool at_end)
      : folder((std::filesystem::temp_directory_path() / "fuzz_fmu-XXXXXX").string()) {
    PROMISE(mkdtemp(folder.data()) != nullptr);
    std::ofstream(folder + "/" + model_text.resource, std::ios::binary)
        .write(reinterpret_cast<const char*>(image.data()), static_cast<std::streamsize>(image.size()));
    char text[39];
    model_guid(image.data(), image.size(), at_end, text);
    guid = text;
    find_variables();
  }
  ~unpacked_fmu() { std::filesystem::remove_all(folder); }
  unpacked_fmu(const unpacked_fmu&) = delete;
  unpacked_fmu& operator=(const unpacked_fmu&) = delete;

 private:
  static constexpr unsigned most_elements = 64;

  /* by asking for them */
  void find_variables() {
    void* const c = version::instantiate(*this);
    PROMISE(c != nullptr);
    PROMISE(version::enter_initialisation(c) == FMU_OK);
    for (const variable_group& group : variable_groups) {
      for (unsigned vr = group.base; vr < group.base + most_elements && find(c, group, vr) && !group_is_done(group);) {
        ++vr;
      }
    }
    for (unsigned vr = VARIABLE_PARAMETER_BASE; elements_of(c, VARIABLE_REAL, vr) == 1; ++vr) {
      parameters.add(vr, 1);
    }
    if (elements_of(c, VARIABLE_REAL, VARIABLE_TIME_REFERENCE) == 1) {
      time.add(VARIABLE_TIME_REFERENCE, 1);
    }
    version::free_instance(c);
  }

  static bool group_is_done(const variable_group& group) { return group.size == SIZE_SCALAR || this_fmi.arrays; }

  bool find(void* c, const variable_group& group, unsigned vr) {
    const std::size_t count = elements_of(c, group.type, vr);
    if (count) {
      list_of(group).add(vr, count);
    }
    if (count && &list_of(group) == &outputs && !group.discrete) {
      smooth_outputs.add(vr, count);
    }
    return count > 0;
  }

  variable_list& list_of(const variable_group& group) {
    if (group.causality == CAUSALITY_INPUT) {
      return inputs;
    }
    if (group.causality == CAUSALITY_PARAMETER && group.type == VARIABLE_REAL) {
      return parameters;
    }
    return group.type == VARIABLE_BOOLEAN ? flags : group.type == VARIABLE_INTEGER ? whole : outputs;
  }

  /* 0: there is no such variable */
  static std::size_t elements_of(void* c, variable_type type, unsigned vr) {
    for (std::size_t count = 1; count <= (this_fmi.arrays ? most_elements : 1); ++count) {
      std::vector<double> numbers(count);
      if (version::read(c, type, {vr}, numbers) == FMU_OK) {
        return count;
      }
    }
    return 0;
  }
};

/* An instance beside a model of the life cycle that the standard prescribes. */
class instance {
 public:
  explicit instance(const unpacked_fmu& fmu) : fmu_(fmu), component_(version::instantiate(fmu)) {
    PROMISE(component_ != nullptr);
  }
  ~instance() { version::free_instance(component_); }
  instance(const instance&) = delete;
  instance& operator=(const instance&) = delete;

  void* component() const { return component_; }
  fmu_phase phase() const { return failed_ ? PHASE_ERROR : phase_; }
  double last_end = 0.0;  // of the last step that was carried out

  byte_list saved() const {
    void* state = nullptr;
    std::size_t size = 0;
    PROMISE(version::get_state(component_, &state) == FMU_OK);
    PROMISE(version::serialized_size(component_, state, &size) == FMU_OK);
    byte_list bytes(size);
    PROMISE(version::serialize(component_, state, bytes.data(), size) == FMU_OK);
    PROMISE(version::free_state(component_, &state) == FMU_OK && state == nullptr);
    return bytes;
  }

  using change = void (*)(instance&);

  /* What has to hold after a call that answered `status`; `next` is what the call does to the life cycle, if anything;
   * `before` is what saved() gave before it, or nothing: saving takes longer than most calls. */
  void answered(fmu_function function, fmu_status status, change next, const byte_list& before) {
    PROMISE(status == FMU_OK || status == FMU_WARNING || status == FMU_DISCARD || status == FMU_ERROR);
    PROMISE(status == FMU_ERROR || call_is_allowed(function, phase()));
    PROMISE(status != FMU_DISCARD || function == CALL_DO_STEP || only_asks(function));
    PROMISE(before.empty() || !(status >= FMU_DISCARD || only_asks(function)) || saved() == before);
    if (status == FMU_ERROR) {
      failed_ = true;
    } else if (next) {
      next(*this);
    }
    // until the first sample is taken, inputs and parameters may be such that there are no outputs
    if (!static_cast<const struct component*>(component_)->waiting) {
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
    std::vector<double> numbers(fmu_.outputs.element_count()), flags(fmu_.flags.element_count());
    PROMISE(version::read(component_, VARIABLE_REAL, fmu_.outputs.references, numbers) == FMU_OK);
    PROMISE(version::read(component_, VARIABLE_BOOLEAN, fmu_.flags.references, flags) == FMU_OK);
    for (const double x : numbers) {
      PROMISE(std::isfinite(x));
    }
    for (const double x : flags) {
      PROMISE(x == 0.0 || x == 1.0);
    }
  }

  const unpacked_fmu& fmu_;
  void* component_;
  fmu_phase phase_ = PHASE_INSTANTIATED;
  bool failed_ = false;
};

}  // namespace calls
