// Time of a step through the FMUs, called from C: bench_fmu [OPTIONS OF GOOGLE BENCHMARK] FILE.json (bench_case.h). Set
// the inputs, step, get six Real and three Boolean groups of outputs, each kind in one call. Counter per_step is the
// figure of docs/evidence/speed.md.
#include <benchmark/benchmark.h>
#include <dlfcn.h>

#include <array>
#include <memory>

#include "bench_case.h"
#include "fmi2Functions.h"
#include "fmi3Functions.h"
#include "variable_table.h"

namespace {

constexpr unsigned joints = 4, tendons = 8;

struct fmu_outputs {
  std::array<double, 6 * joints> numbers;
  std::array<int, joints + 1 + tendons> flags;
};

// A folder of resources with the model image, and its identifier.
struct resource_folder {
  std::filesystem::path path;
  std::array<char, 39> guid = {};

  resource_folder(const std::filesystem::path& folder, const std::vector<unsigned char>& image) : path(folder) {
    std::filesystem::create_directories(path);
    std::ofstream(path / "model.image", std::ios::binary)
        .write(reinterpret_cast<const char*>(image.data()), static_cast<std::streamsize>(image.size()));
    tendonfmu_image_guid(image.data(), image.size(), VARIABLE_TABLE_SALT, guid.data());
  }
};

// A library that stays open until the program ends.
class shared_library {
 public:
  explicit shared_library(const char* path) : handle_(dlopen(path, RTLD_NOW | RTLD_LOCAL)) {
    if (handle_ == nullptr) {
      std::fprintf(stderr, "%s\n", dlerror());
      std::exit(2);
    }
  }
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
  std::vector<Reference> inputs, numbers, flags;

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
};

// Instances that step: 0 of every call is success.
class fmi2_runner {
 public:
  explicit fmi2_runner(const resource_folder& resources)
      : instance_(library_.find<fmi2InstantiateTYPE>("fmi2Instantiate")(
            "bench", fmi2CoSimulation, resources.guid.data(), ("file://" + resources.path.string()).c_str(),
            &callbacks_, fmi2False, fmi2False)) {}
  int start() {
    return library_.find<fmi2ResetTYPE>("fmi2Reset")(instance_) +
           library_.find<fmi2EnterInitializationModeTYPE>("fmi2EnterInitializationMode")(instance_) +
           library_.find<fmi2ExitInitializationModeTYPE>("fmi2ExitInitializationMode")(instance_);
  }
  int set(const double* inputs) { return set_real_(instance_, all_.inputs.data(), all_.inputs.size(), inputs); }
  int step(double time) { return do_step_(instance_, time, 1e-3, fmi2True); }
  int get(fmu_outputs& outputs) {
    return get_real_(instance_, all_.numbers.data(), all_.numbers.size(), outputs.numbers.data()) +
           get_boolean_(instance_, all_.flags.data(), all_.flags.size(), outputs.flags.data());
  }

 private:
  static void say(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String message, ...) {
    std::fprintf(stderr, "%s\n", message);
  }

  shared_library library_{BENCH_FMI2_LIBRARY};
  fmi2CallbackFunctions callbacks_ = {say, std::calloc, std::free, nullptr, nullptr};
  fmi2Component instance_;
  fmi2SetRealTYPE* set_real_ = library_.find<fmi2SetRealTYPE>("fmi2SetReal");
  fmi2DoStepTYPE* do_step_ = library_.find<fmi2DoStepTYPE>("fmi2DoStep");
  fmi2GetRealTYPE* get_real_ = library_.find<fmi2GetRealTYPE>("fmi2GetReal");
  fmi2GetBooleanTYPE* get_boolean_ = library_.find<fmi2GetBooleanTYPE>("fmi2GetBoolean");
  const sample_references<fmi2ValueReference> all_{true};
};

class fmi3_runner {
 public:
  explicit fmi3_runner(const resource_folder& resources)
      : instance_(library_.find<fmi3InstantiateCoSimulationTYPE>("fmi3InstantiateCoSimulation")(
            "bench", resources.guid.data(), (resources.path.string() + "/").c_str(), false, false, false, false,
            nullptr, 0, nullptr, say, nullptr)) {}
  int start() {
    return library_.find<fmi3ResetTYPE>("fmi3Reset")(instance_) +
           library_.find<fmi3EnterInitializationModeTYPE>("fmi3EnterInitializationMode")(instance_, false, 0.0, 0.0,
                                                                                         false, 0.0) +
           library_.find<fmi3ExitInitializationModeTYPE>("fmi3ExitInitializationMode")(instance_);
  }
  int set(const double* inputs) {
    return set_real_(instance_, all_.inputs.data(), all_.inputs.size(), inputs, std::size_t{2} * tendons);
  }
  int step(double time) {
    bool events = false, ends = false, early = false;
    double last = 0.0;
    return do_step_(instance_, time, 1e-3, true, &events, &ends, &early, &last);
  }
  int get(fmu_outputs& outputs) {
    std::array<bool, joints + 1 + tendons> flags;
    std::array<double, 6 * joints>& numbers = outputs.numbers;
    const int status = get_real_(instance_, all_.numbers.data(), all_.numbers.size(), numbers.data(), numbers.size()) +
                       get_boolean_(instance_, all_.flags.data(), all_.flags.size(), flags.data(), flags.size());
    std::copy(flags.begin(), flags.end(), outputs.flags.begin());
    return status;
  }

 private:
  static void say(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String message) {
    std::fprintf(stderr, "%s\n", message);
  }

  shared_library library_{BENCH_FMI3_LIBRARY};
  fmi3Instance instance_;
  fmi3SetFloat64TYPE* set_real_ = library_.find<fmi3SetFloat64TYPE>("fmi3SetFloat64");
  fmi3DoStepTYPE* do_step_ = library_.find<fmi3DoStepTYPE>("fmi3DoStep");
  fmi3GetFloat64TYPE* get_real_ = library_.find<fmi3GetFloat64TYPE>("fmi3GetFloat64");
  fmi3GetBooleanTYPE* get_boolean_ = library_.find<fmi3GetBooleanTYPE>("fmi3GetBoolean");
  const sample_references<fmi3ValueReference> all_{false};
};

template <typename Runner>
int run(Runner& runner, const bench_case& made) {
  fmu_outputs outputs;
  int status = runner.start();
  for (std::size_t k = 0; k < made.samples; ++k) {
    status +=
        runner.set(made.inputs(k).tendon_force) + runner.step(1e-3 * static_cast<double>(k)) + runner.get(outputs);
    benchmark::DoNotOptimize(outputs);
  }
  return status;
}

template <typename Runner>
void add(const char* name, const bench_case& made, const resource_folder& resources) {
  const auto runner = std::make_shared<Runner>(resources);
  benchmark::RegisterBenchmark(name, [=, &made](benchmark::State& state) {
    int status = 0;
    for (auto _ : state) {
      status += run(*runner, made);
    }
    if (status != 0) {
      state.SkipWithError("a call was refused");
    }
    const auto count = static_cast<double>(state.iterations() * static_cast<std::int64_t>(made.samples));
    state.counters["per_step"] = benchmark::Counter(count, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  });
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (argc != 2) {
    std::fprintf(stderr, "usage: bench_fmu FILE.json\n");
    return 2;
  }
  const std::filesystem::path file = argv[1];
  const bench_case made = read_case(file);
  const resource_folder resources(file.parent_path() / "resources", made.image);
  add<fmi2_runner>("fmi2", made, resources);
  add<fmi3_runner>("fmi3", made, resources);
  benchmark::RunSpecifiedBenchmarks();
  benchmark::ClearRegisteredBenchmarks();
  return 0;
}
