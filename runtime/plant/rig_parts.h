/* The parts of a rig file, in the order in which they are read: later ones need the earlier ones' counts. */
#pragma once

#include "json_node.h"
#include "rig.h"

namespace tendonfmu::plant {

/* The finger description has been checked by the core before. */
void read_links(const json_node& finger, const json_node& physics, rig* rig);
void read_tendons(const json_node& finger, const json_node& physics, rig* rig);
void read_friction(const json_node& finger, const json_node& physics, rig* rig);
void read_contact(const json_node& physics, const json_node& pushes, rig* rig);
void read_motion(const json_node& motion, rig* rig);
void read_sensors(const json_node& sensors, rig* rig);

/* What no single number shows: a pretension that can be held, a start within the limits, stiffness within reason,
 * friction that leaves some tension. Throws description_error. Sets the null vector. */
void check_rig(const json_node& document, rig* rig);

}  // namespace tendonfmu::plant
