// Time of a step through the FMUs, called from C: set the 16 inputs, step, get 24 Real and 13 Boolean outputs, each
// kind in one call. Beside it the same samples and outputs through the C interface. Counter per_step is the figure of
// docs/evidence/performance.md. TENDONFMU_BENCH_OTHER: a folder with both libraries of another build, timed in the same
// run.
#include <benchmark/benchmark.h>
#include <dlfcn.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "bench_finger.h"
#include "fmi2Functions.h"
#include "fmi3Functions.h"
#include "variable_table.h"

namespace {

constexpr unsigned joints = 4, tendons = 8;
constexpr std::size_t samples = 20000;

struct fmu_inputs {
  std::array<double, 2 * tendons> numbers;  // forces, positions
};

struct fmu_outputs {
  std::array<double, 6 * joints> numbers;
  std::array<int, joints + 1 + tendons> flags;
};

// A folder of resources with the model image, and its identifier.
class resource_folder {
 public:
  resource_folder()
      : path_(std::filesystem::temp_directory_path() / ("bench_fmu_" + std::to_string(std::random_device()()))) {
    const std::vector<unsigned char> image = bench_finger::image(bench_finger::description(joints, tendons, 5));
    std::filesystem::create_directories(path_);
    std::ofstream(path_ / "model.image", std::ios::binary)
        .write(reinterpret_cast<const char*>(image.data()), static_cast<std::streamsize>(image.size()));
    tendonfmu_image_guid(image.data(), image.size(), VARIABLE_TABLE_SALT, guid_.data());
  }
  ~resource_folder() { std::filesystem::remove_all(path_); }
  resource_folder(const resource_folder&) = delete;
  resource_folder& operator=(const resource_folder&) = delete;

  const char* guid() const { return guid_.data(); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::array<char, 39> guid_ = {};
};

class shared_library {
 public:
  explicit shared_library(const std::string& path) : handle_(dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (handle_ == nullptr) {
      std::fprintf(stderr, "%s\n", dlerror());
      std::exit(2);
    }
  }
  ~shared_library() { dlclose(handle_); }
  shared_library(const shared_library&) = delete;
  shared_library& operator=(const shared_library&) = delete;

  template <typename Function>
  Function* find(const char* name) const {
    return reinterpret_cast<Function*>(dlsym(handle_, name));
  }

 private:
  void* handle_;
};

// The references that every sample sets and gets: one for each element in FMI 2.0, one for each array in FMI 3.0.
template <typename Reference>
struct sample_references {
  explicit sample_references(bool by_element) {
    const auto append = [by_element](std::vector<Reference>& to, variable_group_id group, unsigned elements) {
      for (unsigned i = 0; i < (by_element ? elements : 1); ++i) {
        to.push_back(variable_groups[group].base + i);
      }
    };
    append(inputs, GROUP_TENDON_FORCE, tendons);
    append(inputs, GROUP_TENDON_POSITION, tendons);
    for (const variable_group_id group : {GROUP_COMPENSATED_TORQUE, GROUP_JOINT_TORQUE, GROUP_FRICTION_TORQUE,
                                          GROUP_BIAS_TORQUE, GROUP_JOINT_ANGLE, GROUP_JOINT_SPEED}) {
      append(numbers, group, joints);
    }
    append(flags, GROUP_JOINT_CONTACT, joints);
    append(flags, GROUP_CONTACT, 1);
    append(flags, GROUP_SLACK, tendons);
  }
  std::vector<Reference> inputs, numbers, flags;
};

// An instance that steps: 0 of every call is success.
class fmi2_runner {
 public:
  fmi2_runner(const std::string& library, const resource_folder& resources) : library_(library) {
    const auto create = library_.find<fmi2InstantiateTYPE>("fmi2Instantiate");
    instance_ = create("bench", fmi2CoSimulation, resources.guid(), ("file://" + resources.path().string()).c_str(),
                       &callbacks_, fmi2False, fmi2False);
  }
  ~fmi2_runner() { library_.find<fmi2FreeInstanceTYPE>("fmi2FreeInstance")(instance_); }
  fmi2_runner(const fmi2_runner&) = delete;
  fmi2_runner& operator=(const fmi2_runner&) = delete;

  int start() {
    return library_.find<fmi2ResetTYPE>("fmi2Reset")(instance_) +
           library_.find<fmi2EnterInitializationModeTYPE>("fmi2EnterInitializationMode")(instance_) +
           library_.find<fmi2ExitInitializationModeTYPE>("fmi2ExitInitializationMode")(instance_);
  }
  int set(const fmu_inputs& inputs) {
    return set_real_(instance_, all_.inputs.data(), all_.inputs.size(), inputs.numbers.data());
  }
  int step(double time) { return do_step_(instance_, time, 1e-3, fmi2True); }
  int get(fmu_outputs& outputs) {
    return get_real_(instance_, all_.numbers.data(), all_.numbers.size(), outputs.numbers.data()) +
           get_boolean_(instance_, all_.flags.data(), all_.flags.size(), outputs.flags.data());
  }

 private:
  static void say(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String message, ...) {
    std::fprintf(stderr, "%s\n", message);
  }

  shared_library library_;
  fmi2CallbackFunctions callbacks_ = {say, std::calloc, std::free, nullptr, nullptr};
  fmi2Component instance_ = nullptr;
  fmi2SetRealTYPE* set_real_ = library_.find<fmi2SetRealTYPE>("fmi2SetReal");
  fmi2DoStepTYPE* do_step_ = library_.find<fmi2DoStepTYPE>("fmi2DoStep");
  fmi2GetRealTYPE* get_real_ = library_.find<fmi2GetRealTYPE>("fmi2GetReal");
  fmi2GetBooleanTYPE* get_boolean_ = library_.find<fmi2GetBooleanTYPE>("fmi2GetBoolean");
  const sample_references<fmi2ValueReference> all_{true};
};

class fmi3_runner {
 public:
  fmi3_runner(const std::string& library, const resource_folder& resources) : library_(library) {
    const auto create = library_.find<fmi3InstantiateCoSimulationTYPE>("fmi3InstantiateCoSimulation");
    instance_ = create("bench", resources.guid(), (resources.path().string() + "/").c_str(), false, false, false, false,
                       nullptr, 0, nullptr, say, nullptr);
  }
  ~fmi3_runner() { library_.find<fmi3FreeInstanceTYPE>("fmi3FreeInstance")(instance_); }
  fmi3_runner(const fmi3_runner&) = delete;
  fmi3_runner& operator=(const fmi3_runner&) = delete;

  int start() {
    return library_.find<fmi3ResetTYPE>("fmi3Reset")(instance_) +
           library_.find<fmi3EnterInitializationModeTYPE>("fmi3EnterInitializationMode")(instance_, false, 0.0, 0.0,
                                                                                         false, 0.0) +
           library_.find<fmi3ExitInitializationModeTYPE>("fmi3ExitInitializationMode")(instance_);
  }
  int set(const fmu_inputs& inputs) {
    return set_real_(instance_, all_.inputs.data(), all_.inputs.size(), inputs.numbers.data(), inputs.numbers.size());
  }
  int step(double time) {
    bool events = false, ends = false, early = false;
    return do_step_(instance_, time, 1e-3, true, &events, &ends, &early, &last_);
  }
  int get(fmu_outputs& outputs) {
    std::array<bool, joints + 1 + tendons> given;
    const int status =
        get_real_(instance_, all_.numbers.data(), all_.numbers.size(), outputs.numbers.data(), outputs.numbers.size()) +
        get_boolean_(instance_, all_.flags.data(), all_.flags.size(), given.data(), given.size());
    for (std::size_t i = 0; i < given.size(); ++i) {
      outputs.flags[i] = given[i] ? 1 : 0;
    }
    return status;
  }

 private:
  static void say(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String message) {
    std::fprintf(stderr, "%s\n", message);
  }

  shared_library library_;
  fmi3Instance instance_ = nullptr;
  fmi3SetFloat64TYPE* set_real_ = library_.find<fmi3SetFloat64TYPE>("fmi3SetFloat64");
  fmi3DoStepTYPE* do_step_ = library_.find<fmi3DoStepTYPE>("fmi3DoStep");
  fmi3GetFloat64TYPE* get_real_ = library_.find<fmi3GetFloat64TYPE>("fmi3GetFloat64");
  fmi3GetBooleanTYPE* get_boolean_ = library_.find<fmi3GetBooleanTYPE>("fmi3GetBoolean");
  const sample_references<fmi3ValueReference> all_{false};
  double last_ = 0.0;
};

// The same samples and outputs through the C interface.
class c_runner {
 public:
  c_runner() {
    const std::vector<unsigned char> image = bench_finger::image(bench_finger::description(joints, tendons, 5));
    finger_ = tendonfmu_create(image.data(), image.size(), nullptr, 0);
  }
  ~c_runner() { tendonfmu_destroy(finger_); }
  c_runner(const c_runner&) = delete;
  c_runner& operator=(const c_runner&) = delete;

  int start() {
    const fmu_inputs rest = {};
    tendonfmu_reset(finger_);
    set(rest);
    return tendonfmu_initialise(finger_, 0.0, &inputs_);
  }
  int set(const fmu_inputs& inputs) {
    inputs_.tendon_force = inputs.numbers.data();
    inputs_.tendon_position = inputs.numbers.data() + tendons;
    return 0;
  }
  int step(double time) { return tendonfmu_step(finger_, time, &inputs_); }
  int get(fmu_outputs& outputs) {
    std::array<unsigned char, joints + 1 + tendons> flags;
    double* number = outputs.numbers.data();
    tendonfmu_outputs to = {};
    for (double** row : {&to.compensated_torque, &to.joint_torque, &to.friction_torque, &to.bias_torque,
                         &to.joint_angle, &to.joint_speed}) {
      *row = number;
      number += joints;
    }
    to.joint_contact = flags.data();
    to.contact = flags.data() + joints;
    to.slack = flags.data() + joints + 1;
    const int status = tendonfmu_get_outputs(finger_, &to);
    for (std::size_t i = 0; i < flags.size(); ++i) {
      outputs.flags[i] = flags[i];
    }
    return status;
  }

 private:
  tendonfmu_finger* finger_ = nullptr;
  tendonfmu_inputs inputs_ = {};
};

std::vector<fmu_inputs> input_rows() {
  const bench_finger::made_recording r = bench_finger::motion(joints, tendons, samples);
  std::vector<fmu_inputs> rows(samples);
  for (std::size_t k = 0; k < samples; ++k) {
    for (std::size_t i = 0; i < tendons; ++i) {
      rows[k].numbers[i] = r.force[k * tendons + i];
      rows[k].numbers[tendons + i] = r.position[k * tendons + i];
    }
  }
  return rows;
}

// Sum of all outputs over the recording, the same for every way; times are worth nothing where it is not.
template <typename Runner>
double run(Runner& runner, const std::vector<fmu_inputs>& rows, int& status) {
  double sum = 0.0;
  fmu_outputs outputs;
  status += runner.start();
  for (std::size_t k = 0; k < rows.size(); ++k) {
    status += runner.set(rows[k]) + runner.step(1e-3 * static_cast<double>(k + 1)) + runner.get(outputs);
    benchmark::DoNotOptimize(outputs);
    sum += outputs.numbers[k % outputs.numbers.size()] + outputs.flags[k % outputs.flags.size()];
  }
  return sum;
}

template <typename Runner>
void steps(benchmark::State& state, Runner& runner) {
  static const std::vector<fmu_inputs> rows = input_rows();
  static const double expected = [] {
    int status = 0;
    c_runner reference;
    return run(reference, rows, status);
  }();
  int status = 0;
  bool same = true;
  for (auto _ : state) {
    same = run(runner, rows, status) == expected && same;
  }
  if (status != 0 || !same) {
    state.SkipWithError("a call was refused, or outputs differ from those of the C interface");
  }
  state.counters["per_step"] = benchmark::Counter(static_cast<double>(state.iterations()) * samples,
                                                  benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

template <typename Runner>
void add(const std::string& name, std::shared_ptr<Runner> runner) {
  benchmark::RegisterBenchmark(name.c_str(), [runner](benchmark::State& state) {
    steps(state, *runner);
  })->Unit(benchmark::kMillisecond);
}

}  // namespace

int main(int argc, char** argv) {
  const resource_folder resources;
  add("c", std::make_shared<c_runner>());
  add("fmi2", std::make_shared<fmi2_runner>(BENCH_FMI2_LIBRARY, resources));
  add("fmi3", std::make_shared<fmi3_runner>(BENCH_FMI3_LIBRARY, resources));
  if (const char* other = std::getenv("TENDONFMU_BENCH_OTHER")) {
    const auto library = [other](const char* path) {
      return (std::filesystem::path(other) / std::filesystem::path(path).filename()).string();
    };
    add("fmi2/other", std::make_shared<fmi2_runner>(library(BENCH_FMI2_LIBRARY), resources));
    add("fmi3/other", std::make_shared<fmi3_runner>(library(BENCH_FMI3_LIBRARY), resources));
  }
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  benchmark::ClearRegisteredBenchmarks();
  return 0;
}
