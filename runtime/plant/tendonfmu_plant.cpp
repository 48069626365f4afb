/* The C interface: no exception passes it. */
#include "tendonfmu_plant.h"

#include <cstring>
#include <memory>
#include <new>
#include <string>

#include "bytes.h"
#include "description_error.h"
#include "motion.h"
#include "plant.h"

struct tendonfmu_plant {
  tendonfmu_plant(tendonfmu::plant::rig numbers, std::uint64_t identity) : finger(std::move(numbers), identity) {}

  tendonfmu::plant::plant finger;
  mutable std::string last_error;
};

namespace {

using tendonfmu::plant::refusal;

/* Without memory for the line there is none. */
void note(const tendonfmu_plant* plant, const char* line) noexcept {
  try {
    plant->last_error = line;
  } catch (...) {
    plant->last_error.clear();
  }
}

/* Runs a call and turns what it throws into a status and a line. */
template <class Call>
tendonfmu_plant_status guarded(const tendonfmu_plant* plant, Call call) noexcept {
  if (!plant) {
    return TENDONFMU_PLANT_BAD_ARGUMENT;
  }
  try {
    call();
    return TENDONFMU_PLANT_OK;
  } catch (const refusal& refused) {
    note(plant, refused.what());
    return refused.status;
  } catch (const std::bad_alloc&) {
    note(plant, "out of memory");
  } catch (const std::exception& failed) {  // solver_error, and what nobody has thought of
    note(plant, failed.what());
  } catch (...) {
    note(plant, "failed for an unknown reason");
  }
  return TENDONFMU_PLANT_SOLVER;
}

void need_pointer(const void* pointer, const char* name) {
  if (!pointer) {
    throw refusal(TENDONFMU_PLANT_BAD_ARGUMENT, std::string(name) + ": expected a pointer, not NULL");
  }
}

}  // namespace

tendonfmu_plant* tendonfmu_plant_create(const char* rig_json, size_t size, char* message, size_t message_size) {
  if (!message) {
    message_size = 0;
  }
  try {
    if (!rig_json) {
      throw tendonfmu::description_error("rig: expected a text, not NULL");
    }
    return new tendonfmu_plant(tendonfmu::plant::read_rig(rig_json, size), hash_bytes(rig_json, size, 0));
  } catch (const std::bad_alloc&) {
    tendonfmu::copy_line("rig: out of memory", message, message_size);
  } catch (const std::exception& refused) {
    tendonfmu::copy_line(refused.what(), message, message_size);
  } catch (...) {
    tendonfmu::copy_line("rig: cannot be read", message, message_size);
  }
  return nullptr;
}

void tendonfmu_plant_destroy(tendonfmu_plant* plant) {
  delete plant;
}

size_t tendonfmu_plant_joint_count(const tendonfmu_plant* plant) {
  return plant ? plant->finger.the_rig().joint_count() : 0;
}

size_t tendonfmu_plant_tendon_count(const tendonfmu_plant* plant) {
  return plant ? plant->finger.the_rig().tendon_count() : 0;
}

const char* tendonfmu_plant_last_error(const tendonfmu_plant* plant) {
  return plant ? plant->last_error.c_str() : "";
}

tendonfmu_plant_status tendonfmu_plant_get_settings(const tendonfmu_plant* plant, tendonfmu_plant_settings* settings) {
  return guarded(plant, [&] {
    need_pointer(settings, "settings");
    *settings = plant->finger.settings();
  });
}

tendonfmu_plant_status tendonfmu_plant_set_settings(tendonfmu_plant* plant, const tendonfmu_plant_settings* settings) {
  return guarded(plant, [&] {
    need_pointer(settings, "settings");
    plant->finger.set_settings(*settings);
  });
}

tendonfmu_plant_status tendonfmu_plant_set_inputs(tendonfmu_plant* plant, const tendonfmu_plant_inputs* inputs) {
  return guarded(plant, [&] {
    need_pointer(inputs, "inputs");
    plant->finger.set_inputs(*inputs);
  });
}

tendonfmu_plant_status tendonfmu_plant_initialise(tendonfmu_plant* plant) {
  return guarded(plant, [&] { plant->finger.initialise(); });
}

int tendonfmu_plant_is_initialised(const tendonfmu_plant* plant) {
  return plant && plant->finger.initialised();
}

tendonfmu_plant_status tendonfmu_plant_hold_command(const tendonfmu_plant* plant, double* command) {
  return guarded(plant, [&] {
    need_pointer(command, "command");
    tendonfmu::plant::hold_command(plant->finger.the_rig(), command);
  });
}

tendonfmu_plant_status tendonfmu_plant_advance(tendonfmu_plant* plant, double time) {
  return guarded(plant, [&] { plant->finger.advance(time); });
}

double tendonfmu_plant_get_time(const tendonfmu_plant* plant) {
  return plant ? plant->finger.time() : 0.0;
}

tendonfmu_plant_status tendonfmu_plant_get_signals(const tendonfmu_plant* plant,
                                                   const tendonfmu_plant_signals* signals) {
  return guarded(plant, [&] {
    need_pointer(signals, "signals");
    plant->finger.write_signals(*signals, 0);
  });
}

tendonfmu_plant_status tendonfmu_plant_run(tendonfmu_plant* plant, size_t samples, const double* time,
                                           const tendonfmu_plant_signals* signals, size_t* done) {
  size_t row = 0;
  const tendonfmu_plant_status status = guarded(plant, [&] {
    need_pointer(time, "time");
    need_pointer(signals, "signals");
    for (; row < samples; ++row) {
      plant->finger.advance(time[row]);
      plant->finger.write_signals(*signals, row);
    }
  });
  if (done) {
    *done = row;
  }
  return status;
}

size_t tendonfmu_plant_state_size(const tendonfmu_plant* plant) {
  std::size_t size = 0;
  guarded(plant, [&] { size = plant->finger.state_bytes(); });
  return size;
}

tendonfmu_plant_status tendonfmu_plant_save_state(const tendonfmu_plant* plant, void* bytes, size_t size) {
  return guarded(plant, [&] {
    need_pointer(bytes, "bytes");
    plant->finger.save(bytes, size);
  });
}

tendonfmu_plant_status tendonfmu_plant_restore_state(tendonfmu_plant* plant, const void* bytes, size_t size) {
  return guarded(plant, [&] {
    need_pointer(bytes, "bytes");
    plant->finger.restore(bytes, size);
  });
}

tendonfmu_plant_status tendonfmu_plant_reset(tendonfmu_plant* plant) {
  return guarded(plant, [&] { plant->finger.reset(); });
}

tendonfmu_plant_status tendonfmu_plant_get_statistics(const tendonfmu_plant* plant, tendonfmu_plant_statistics* found) {
  return guarded(plant, [&] {
    need_pointer(found, "found");
    const tendonfmu::plant::statistics work = plant->finger.work();
    *found = {work.steps, work.right_hand_sides, work.jacobians, work.roots, work.restarts};
  });
}

size_t tendonfmu_plant_order(const tendonfmu_plant* plant) {
  return plant ? plant->finger.the_rig().order() : 0;
}

tendonfmu_plant_status tendonfmu_plant_derivative(const tendonfmu_plant* plant, double time, const double* state,
                                                  double* derivative) {
  return guarded(plant, [&] {
    need_pointer(state, "state");
    need_pointer(derivative, "derivative");
    plant->finger.derivative(time, state, derivative);
  });
}

tendonfmu_plant_status tendonfmu_plant_get_continuous_state(const tendonfmu_plant* plant, double* state) {
  return guarded(plant, [&] {
    need_pointer(state, "state");
    const std::vector<double>& now = plant->finger.continuous_state();
    std::memcpy(state, now.data(), sizeof(double) * now.size());
  });
}
