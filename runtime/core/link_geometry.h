/* Where the links of a finger are: a chain of joints that turn about axes
 * (docs/reference/semantics/contact_place.md#link-geometry). */
#pragma once

#include <stddef.h>

typedef struct link_geometry {
  double* axis;   /* [n × 3] unit vectors, each in its own link's frame */
  double* offset; /* [n × 3] m, each joint in the frame of the link before */
  double* tip;    /* [3] m, in the frame of the last link */
} link_geometry;

/* Scales a vector that is not zero to length 1, however long or short it is. */
void make_unit(double vector[3]);

/* The levers of a force at the tip, J of docs/reference/semantics/contact_place.md#force-at-the-fingertip:
 * a force F turns joint j with lever_j · F.
 *   angle   [joints] rad
 *   lever   [joints × 3] m, base frame */
void find_tip_levers(const link_geometry* geometry, size_t joints, const double* angle, double* lever);

/* For each joint the least link, from 1, on which a force that turns this joint can be: the first from there on whose
 * end is off its own axis, the last link where none is. least [joints]. */
void find_least_links(const link_geometry* geometry, size_t joints, int* least);
