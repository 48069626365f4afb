/* The parameters of a finger: path, unit, allowed range of each, and what they must be together. */
#pragma once

#include "message.h"
#include "model_image.h"

enum { PARAMETER_PATH_BYTES = 80 };

typedef struct parameter_range {
  const char* unit; /* FMI notation */
  double minimum, maximum;
  int above_minimum; /* the minimum itself is not allowed */
  int tunable;
} parameter_range;

/* Writes the path of parameter `index` of an item into path [PARAMETER_PATH_BYTES], with its zero. */
void parameter_path(const model_item* item, uint32_t index, char* path);

parameter_range parameter_range_of(const model_item* item, uint32_t index);

/* The item that holds parameter `index`; index must be below parameter_count. */
model_item parameter_item(const model_shape* shape, uint32_t index);

/* Index of a path, parameter_count when there is none. */
uint32_t parameter_find(const model_shape* shape, const char* path);

/* Appends the range with its unit: "0 to 1e+09 N.m", "above 0 and at most 1e+12 N/m". */
void parameter_say_range(const model_item* item, uint32_t index, message_line message);

/* Checks one value. Returns 0, or −1 with one line in message: path, value, range, unit. */
int parameter_check_value(const model_item* item, uint32_t index, double value, message_line message);

/* Checks all values [parameter_count] and their relations: static >= coulomb, angles strictly increasing, moment arms
 * of full column rank. Returns 0, or −1 with one line in message. */
int parameter_check_all(const model_shape* shape, const double* values, message_line message);

/* Only the relations within laws and grids, or only the rank of the routing. */
int parameter_check_relations(const model_shape* shape, const double* values, message_line message);
int parameter_check_routing(const model_shape* shape, const double* values, message_line message);
