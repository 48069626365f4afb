#include "call_table.h"

const char* call_name(fmu_function function) {
  return this_fmi.calls[function].name;
}

int call_is_allowed(fmu_function function, fmu_phase phase) {
  return (this_fmi.calls[function].allowed >> phase) & 1;
}

const char* phase_name(fmu_phase phase) {
  return this_fmi.phases[phase];
}
