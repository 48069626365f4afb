/* Functions of FMI that refuse by name whatever they are given. */
#pragma once

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#elif defined(_MSC_VER)
#pragma warning(disable : 4100)
#endif

/* Defines one: `parameters` are those of the standard, the first is `instance`. */
#define REFUSE(status, function, reason, parameters)                                           \
  status function parameters {                                                                 \
    return (status)(instance ? component_fail(instance, #function, "%s", reason) : FMU_ERROR); \
  }
