/* Reads the rig, which takes the JSON readers, and would settle it, which takes SUNDIALS. */
#include <stdio.h>
#include <string.h>
#include <tendonfmu_plant.h>

int main(void) {
  const char* rig = "{\"format\": \"tendonfmu-rig-0\"}";
  char message[512] = "";
  tendonfmu_plant* plant = tendonfmu_plant_create(rig, strlen(rig), message, sizeof message);
  if (plant)
    tendonfmu_plant_initialise(plant);
  tendonfmu_plant_destroy(plant);
  return puts(message) < 0;
}
