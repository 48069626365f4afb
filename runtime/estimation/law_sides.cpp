#include "law_sides.h"

namespace tendonfmu::estimation {
namespace {

struct law_search {
  const unknown_list& unknowns;
  std::size_t lanes;
  placed_laws* found;
  std::uint32_t next_record = 2; /* as derived_numbers.c counts them */
  std::uint32_t points = 1;      /* working points of the edge being read */
};

/* an edge with K laws has K + 2 records: L1 L1 L2 … LK LK */
void add_edge(law_search* search, const model_item& item, const law_sides& sides) {
  const std::uint32_t points = item.has_angles ? search->points : 1, first = search->next_record;
  search->found->edge[first + item.point + 1] = sides;
  if (item.point == 0) {
    search->found->edge[first] = sides;
  }
  if (item.point + 1 == points) {
    search->found->edge[first + points + 1] = sides;
    search->next_record += points + 2;
  }
}

int add_item(void* context, const model_item* item) {
  law_search* search = static_cast<law_search*>(context);
  const auto sides = [&]() -> law_sides {
    return {&search->unknowns.side(item->first),
            &search->unknowns.side(item->first + (item->law == LAW_ASYMMETRIC ? 4 : 0))};
  };
  placed_laws* found = search->found;
  switch (item->kind) {
    case ITEM_JOINT_FRICTION: found->joint[item->joint] = sides(); break;
    case ITEM_LOAD_FRICTION: found->load[item->joint] = sides(); break;
    case ITEM_PULLEY_FRICTION: found->pulley[(item->joint + 1) * search->lanes + item->tendon] = sides(); break;
    case ITEM_EDGE_ANGLES: search->points = item->count; break;
    case ITEM_EDGE_FRICTION: add_edge(search, *item, sides()); break;
    case ITEM_COVER:
      found->covers.push_back(
          {item->joint, search->unknowns.plain(item->first), search->unknowns.plain(item->first + 1)});
      break;
    default: break;
  }
  return 0;
}

}  // namespace

placed_laws::placed_laws(const unknown_list& unknowns, const tendonfmu_finger* finger)
    : edge(2 + finger->shape.edge_law_count + 2 * std::size_t{finger->shape.edge_count}),
      pulley(finger->joints * finger->tendon_lanes),
      joint(finger->joint_lanes),
      load(finger->joint_lanes) {
  law_search search{unknowns, finger->tendon_lanes, this};
  model_visit(&finger->shape, add_item, &search);
}

}  // namespace tendonfmu::estimation
