// Time of a step of the FMU by FMI 2.0, called from C: bench_fmu [OPTIONS OF GOOGLE BENCHMARK] FILE.image
// (bench_case.h). Set the inputs, step, get six Real and three Boolean groups of outputs, each kind in one call.
#include <dlfcn.h>

#include <array>
#include <cstdio>
#include <cstdlib>

#include "bench_case.h"
#include "fmi2Functions.h"
#include "variable_table.h"

namespace {

constexpr unsigned joints = 4, tendons = 8;
using references = std::vector<fmi2ValueReference>;

// The references of all elements of groups.
references elements_of(std::initializer_list<std::pair<variable_group_id, unsigned>> groups) {
  references all;
  for (const auto& [group, elements] : groups) {
    for (unsigned i = 0; i < elements; ++i) {
      all.push_back(variable_groups[group].base + i);
    }
  }
  return all;
}

// A function of the FMU's library, which stays open until the program ends.
template <typename Function>
Function* find(const char* name) {
  static void* const library = dlopen(BENCH_FMI2_LIBRARY, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    std::fprintf(stderr, "%s\n", dlerror());
    std::exit(2);
  }
  return reinterpret_cast<Function*>(dlsym(library, name));
}

void say(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String message, ...) {
  std::fprintf(stderr, "%s\n", message);
}

// An instance of the finger; its resources are beside the file.
fmi2Component instance_of(const std::filesystem::path& file, const bench_case& made) {
  const std::filesystem::path resources = file.parent_path() / "resources";
  std::filesystem::create_directories(resources);
  std::filesystem::copy_file(file, resources / "model.image", std::filesystem::copy_options::overwrite_existing);
  std::array<char, 39> guid = {};
  tendonfmu_image_guid(made.image.data(), made.image.size(), VARIABLE_TABLE_SALT, guid.data());
  static const fmi2CallbackFunctions callbacks = {say, std::calloc, std::free, nullptr, nullptr};
  const std::string location = "file://" + resources.string();
  return find<fmi2InstantiateTYPE>("fmi2Instantiate")("bench", fmi2CoSimulation, guid.data(), location.c_str(),
                                                      &callbacks, fmi2False, fmi2False);
}

// The sum of all statuses: 0 where every call succeeded.
int run(fmi2Component instance, const bench_case& made) {
  static const auto set_real = find<fmi2SetRealTYPE>("fmi2SetReal");
  static const auto do_step = find<fmi2DoStepTYPE>("fmi2DoStep");
  static const auto get_real = find<fmi2GetRealTYPE>("fmi2GetReal");
  static const auto get_boolean = find<fmi2GetBooleanTYPE>("fmi2GetBoolean");
  static const references inputs = elements_of({{GROUP_TENDON_FORCE, tendons}, {GROUP_TENDON_POSITION, tendons}});
  static const references numbers = elements_of({{GROUP_COMPENSATED_TORQUE, joints},
                                                 {GROUP_JOINT_TORQUE, joints},
                                                 {GROUP_FRICTION_TORQUE, joints},
                                                 {GROUP_BIAS_TORQUE, joints},
                                                 {GROUP_JOINT_ANGLE, joints},
                                                 {GROUP_JOINT_SPEED, joints}});
  static const references flags =
      elements_of({{GROUP_JOINT_CONTACT, joints}, {GROUP_CONTACT, 1}, {GROUP_SLACK, tendons}});
  std::array<double, 6 * joints> values;
  std::array<int, joints + 1 + tendons> answers;
  int status = find<fmi2ResetTYPE>("fmi2Reset")(instance) +
               find<fmi2EnterInitializationModeTYPE>("fmi2EnterInitializationMode")(instance) +
               find<fmi2ExitInitializationModeTYPE>("fmi2ExitInitializationMode")(instance);
  for (std::size_t k = 0; k < made.samples; ++k) {
    status += set_real(instance, inputs.data(), inputs.size(), made.inputs(k));
    status += do_step(instance, 1e-3 * static_cast<double>(k), 1e-3, fmi2True);
    status += get_real(instance, numbers.data(), numbers.size(), values.data());
    status += get_boolean(instance, flags.data(), flags.size(), answers.data());
    benchmark::DoNotOptimize(values);
    benchmark::DoNotOptimize(answers);
  }
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (argc != 2) {
    std::fprintf(stderr, "usage: bench_fmu FILE.image\n");
    return 2;
  }
  const bench_case made(argv[1]);
  const fmi2Component instance = instance_of(argv[1], made);
  benchmark::RegisterBenchmark("fmi2", [&](benchmark::State& state) {
    int status = 0;
    for (auto _ : state) {
      status += run(instance, made);
    }
    if (status != 0) {
      state.SkipWithError("a call was refused");
    }
    count_steps(state, made);
  });
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
