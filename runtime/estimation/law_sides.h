/* Where the laws of a finger stand, and which columns their sides move. */
#pragma once

#include <array>
#include <vector>

#include "unknowns.h"

namespace tendonfmu::estimation {

/* Of one law: its side for v > 0 and the one for v < 0, which are the same of a symmetric law; null without friction.
 */
using law_sides = std::array<const side_columns*, 2>;

/* A joint with a cover: columns of stiffness and rest angle, −1 where fixed. */
struct cover_columns {
  std::size_t joint;
  std::int32_t stiffness, rest_angle;
};

/* The laws by the arrays of derived_numbers that hold their numbers. */
struct placed_laws {
  /* both must outlive it */
  placed_laws(const unknown_list& unknowns, const tendonfmu_finger* finger);

  std::vector<law_sides> edge;        /* [records] as edge_law has them */
  std::vector<law_sides> pulley;      /* [n × M] */
  std::vector<law_sides> joint, load; /* [N] T_jv0, T_jvf */
  std::vector<cover_columns> covers;
};

}  // namespace tendonfmu::estimation
