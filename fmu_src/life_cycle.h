/* The life of an instance: creation, logging, experiment, initialisation, steps, end. What the functions of both
 * versions of FMI do; the caller adds types and arguments of its own version. */
#pragma once

#include "component.h"

/* NULL, with the reason in the log. `identifier` is what the importer read in modelDescription.xml, `resources` the URI
 * or path of the folder. */
component* life_create(const log_target* log, const char* identifier, const char* resources);
component* life_refuse(const log_target* log, const char* format, ...) LOG_FORMAT(2);

fmu_status life_set_logging(component* c, int on, size_t count, const char* const categories[]);

typedef struct experiment {
  int tolerance_defined, stop_time_defined;
  double tolerance, start_time, stop_time;
} experiment;

/* `function` is the one that brings the experiment: not the same in both versions. */
fmu_status life_set_experiment(component* c, fmu_function function, const experiment* e);
fmu_status life_enter_initialisation(component* c);
fmu_status life_exit_initialisation(component* c);
fmu_status life_terminate(component* c);
fmu_status life_reset(component* c);
fmu_status life_step(component* c, double time, double step);
