/* What an FMI function returns; the numbers are those of fmi2Status and fmi3Status. */
#ifndef TENDONFMU_STATUS_H
#define TENDONFMU_STATUS_H

typedef enum fmu_status { FMU_OK, FMU_WARNING, FMU_DISCARD, FMU_ERROR } fmu_status;

#endif
