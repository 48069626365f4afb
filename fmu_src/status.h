/* What an FMI function returns; the numbers are those of fmi2Status and fmi3Status. */
#pragma once

typedef enum fmu_status { FMU_OK, FMU_WARNING, FMU_DISCARD, FMU_ERROR } fmu_status;
