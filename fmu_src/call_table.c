#include "call_table.h"

const char* call_name(fmu_function function) {
  return this_fmi.calls[function].name;
}

const char* phase_name(fmu_phase phase) {
  return this_fmi.phases[phase];
}
