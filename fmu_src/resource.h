/* Files of the FMU's resources folder, which importers hand over as a URI (FMI 2.0) or as a path (FMI 3.0). */
#pragma once

#include <stddef.h>

#include "log.h"

/* Reads a whole file of the folder.
 *   location      "file:/x", "file:///x", "file:///C:/x" or "file://localhost/x", percent-encoded UTF-8, or a path
 *   name          file name, ASCII
 *   size          receives the number of bytes
 *   argument      what the version of FMI calls the location
 *   reason        receives the text on failure
 * Returns a block for free(), or NULL. No handle stays open. */
void* resource_read(const char* location, const char* name, size_t* size, const char* argument, log_text* reason);
