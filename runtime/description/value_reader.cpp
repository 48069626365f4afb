#include "value_reader.h"

#include <exception>
#include <optional>
#include <string>

namespace tendonfmu {
namespace {

/* Values of numbers left out. The two thresholds keep sensor noise of a finger at rest below v_min, the cutoff passes
 * the motion of a hand (up to some 5 Hz) with little delay, and the filter's figures suit torques of about 1 N·m. */
std::optional<double> default_value(const model_item& item, std::uint32_t offset) {
  if (item.law != LAW_ABSENT) {
    return offset % 4 == 3 ? std::optional<double>(0.0) : std::nullopt; /* viscous */
  }
  switch (item.kind) {
    case ITEM_COVER: return offset == 1 ? std::optional<double>(0.0) : std::nullopt; /* rest_angle */
    case ITEM_TENDON_THRESHOLD: return 0.0005;
    case ITEM_JOINT_THRESHOLD: return 0.01;
    case ITEM_FILTER_CUTOFF: return 20.0;
    case ITEM_DRIFT_VARIANCE: return 1e-6;
    case ITEM_NOISE_STD: return 0.01;
    case ITEM_NOISE_STD_PER_FORCE: return 0.0;
    case ITEM_FORGET_RATE: return 5.0;
    case ITEM_CONTACT_PER_FORCE:
    case ITEM_HYSTERESIS:
    case ITEM_INNOVATION_PER_FORCE:
    case ITEM_STUCK_SHARE:
    case ITEM_STUCK_TIME:
    case ITEM_JUMP_SHARE:
    case ITEM_DEVIATION:
    case ITEM_DEVIATION_PER_FORCE:
    case ITEM_HOLD_TIME:
    case ITEM_LINK_OFFSET:
    case ITEM_DRIFT_PER_FORCE:
    case ITEM_REST_PER_FORCE:
    case ITEM_REST_CREEP:
    case ITEM_UNCERTAINTY: return 0.0; /* joints with fewer directions than others */
    case ITEM_JUMP_TIME: return 0.06;
    case ITEM_JERK_DENSITY: return 1.0; /* a hand: least friction error on two families of fingers */
    case ITEM_UNCERTAINTY_LEVEL: return 3.0;
    case ITEM_RELEASE_RATIO: return 1.0;
    case ITEM_DRIFT_QUICK_TIME: return 0.3;     /* longer than a stroke's edge, shorter than a slow load */
    case ITEM_DRIFT_SLOW_TIME: return 10.0;     /* the slowest load that it is for */
    case ITEM_REST_SETTLE_TIME: return 0.3;     /* a servo's ringing and most of what relaxes after a stop */
    case ITEM_REST_AVERAGING_TIME: return 0.03; /* noise falls, and a push is late by no more than a touch takes */
    case ITEM_REST_FALL_SHARE:
      return 0.05; /* of the virtual hand's pushes at rest, few holds break and most ends show */
    case ITEM_FAULT_HOLD_TIME: return 0.05;           /* channels are read up to some 20 ms apart */
    case ITEM_FAULT_FORCE_RESOLUTION: return 0.01;    /* of a load cell of 100 N: a part in 10,000 */
    case ITEM_FAULT_POSITION_RESOLUTION: return 2e-6; /* an encoder of 12 bits on a spool of 1 cm */
    case ITEM_FAULT_JUMP_MARGIN:
      return 1.0; /* several times what noise and sampling make of it on five families of fingers */
    case ITEM_FAULT_RECOVERY_TIME: return 0.5; /* a loose contact that comes back for less is not well */
    case ITEM_EXTENSION:
      return item.effect->parameters[offset].required
                 ? std::nullopt
                 : std::optional<double>(item.effect->parameters[offset].missing_value);
    default: return std::nullopt;
  }
}

double read_value(const json_node& document, const model_item& item, std::uint32_t index) {
  char path[PARAMETER_PATH_BYTES];
  parameter_path(&item, index, path);
  const json_node node = document.find(path);
  if (node.value().is_number()) {
    return node.value().get<double>();
  }
  const std::optional<double> missing = default_value(item, index - item.first);
  if (node.absent() && missing) {
    return *missing;
  }
  char range[120] = "";
  parameter_say_range(&item, index, message_line{range, sizeof range});
  node.refuse("a number, " + std::string(range));
}

/* No exception may pass through the C code that calls visit(), so one is carried around it. */
struct reading {
  const json_node& document;
  std::vector<double> values;
  std::exception_ptr failure;
};

int visit(void* context, const model_item* item) {
  reading& r = *static_cast<reading*>(context);
  try {
    for (std::uint32_t i = item->first; i < item->first + item->count; ++i) {
      r.values[i] = read_value(r.document, *item, i);
    }
    return 0;
  } catch (...) {
    r.failure = std::current_exception();
    return -1;
  }
}

}  // namespace

std::vector<double> read_values(const json_node& document, const model_shape& shape) {
  reading r{document, std::vector<double>(shape.parameter_count), nullptr};
  model_visit(&shape, visit, &r);
  if (r.failure) {
    std::rethrow_exception(r.failure);
  }
  return r.values;
}

}  // namespace tendonfmu
