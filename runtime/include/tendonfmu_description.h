/* From a finger description (JSON, format "tendonfmu-finger-1") to the model image that tendonfmu_create() takes.
 * In the library tendonfmu_description (C++17), callable from C. Thread safe; uses the heap. */
#ifndef TENDONFMU_DESCRIPTION_H
#define TENDONFMU_DESCRIPTION_H

#include "tendonfmu.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads and validates a description and makes its model image.
 *   json          [json_size] bytes of UTF-8, not modified, no terminating zero needed
 *   image         receives a block of *image_size bytes, to be given back by tendonfmu_free_image(); NULL on failure
 *   message       [message_size] receives one line: key path, value, allowed range, unit
 * Returns TENDONFMU_OK, TENDONFMU_BAD_IMAGE (the description is refused) or TENDONFMU_BAD_ARGUMENT. */
tendonfmu_status tendonfmu_image_from_json(const char* json, size_t json_size, void** image, size_t* image_size,
                                           char* message, size_t message_size);

/* Frees an image of tendonfmu_image_from_json(). NULL is allowed. */
void tendonfmu_free_image(void* image);

#ifdef __cplusplus
}
#endif

#endif
