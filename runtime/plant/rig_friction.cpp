#include <algorithm>

#include "description_error.h"
#include "rig_values.h"

namespace tendonfmu::plant {
namespace {

constexpr std::size_t most_working_points = 256;

/* One side, scaled by `factor`. LuGre needs sliding friction wherever there is any: without it the bristle would have
 * no level to slide at. */
law_side read_side(const json_node& node, double factor) {
  law_side side;
  side.break_away = factor * number_in(node, "static", {0.0, 1e6, ""});
  side.sliding = factor * number_in(node, "coulomb", {0.0, 1e6, ""});
  side.stribeck_rate = 1.0 / number_in(node, "stribeck_velocity", {0.0, 1e6, "m/s or rad/s", true});
  side.viscous = factor * number_in(node, "viscous", {0.0, 1e6, ""}, 0.0);
  if (side.break_away > 0.0 && side.sliding < 1e-6 * side.break_away) {
    node.member("coulomb").refuse("a positive number where `static` is one: bristles need sliding friction");
  }
  return side;
}

law read_law(const json_node& node, double asymmetry) {
  const bool two_sided = !node.member("positive").absent();
  const json_node positive = two_sided ? node.member("positive") : node;
  const json_node negative = two_sided ? node.member("negative") : node;
  law found = {read_side(positive, 1.0 + asymmetry), read_side(negative, 1.0 - asymmetry), 0.0};
  found.break_away = 0.5 * (found.positive.break_away + found.negative.break_away);
  // the bristle is measured by the mean of both sides: it must have a level to slide at on either
  for (const bool negative_side : {false, true}) {
    const law_side& side = negative_side ? found.negative : found.positive;
    if (side.sliding >= 1e-6 * found.break_away && side.break_away >= 1e-6 * found.break_away) {
      continue;
    }
    (negative_side ? negative : positive)
        .member("coulomb")
        .refuse("a positive number where the other side's `static` is one: bristles need sliding friction");
  }
  return found;
}

law_by_angle read_laws(const json_node& node, double asymmetry) {
  law_by_angle found;
  const json_node laws = node.member("laws");
  if (laws.absent()) {
    found.laws.push_back(read_law(node, asymmetry));
    return found;
  }
  laws.expect_list(1, most_working_points, "laws");
  found.angles = numbers_in(node, "angles", laws.size(), any_angle, false);
  for (std::size_t k = 0; k < laws.size(); ++k) {
    found.laws.push_back(read_law(laws.element(k), asymmetry));
  }
  return found;
}

struct presliding {
  double pulley, edge, joint;
};

presliding read_presliding(const json_node& friction) {
  const json_node node = friction.member("presliding");
  node.expect_keys_if_present({"pulley", "edge", "joint"});
  return {number_in(node, "pulley", {0.0, 1.0, "m", true}, 25e-6),
          number_in(node, "edge", {0.0, 1.0, "m", true}, 40e-6),
          number_in(node, "joint", {0.0, 10.0, "rad", true}, 0.004)};
}

/* Edges that the rig gives another shape than working points. */
void read_diversions(const json_node& friction, double asymmetry, rig* rig) {
  const json_node list = friction.member("edges");
  if (list.absent()) {
    return;
  }
  list.expect_list(0, max_joints * max_tendons, "edges");
  for (std::size_t k = 0; k < list.size(); ++k) {
    const json_node node = list.element(k);
    node.expect_keys({"tendon", "joint", "shape", "rest", "slope", "centre", "coefficient", "negative_coefficient"});
    const std::size_t tendon = index_in(node, "tendon", 1, rig->tendon_count()) - 1;
    const std::size_t joint = index_in(node, "joint", 2, rig->joint_count()) - 1;
    const auto site = std::find_if(rig->sites.begin(), rig->sites.end(), [&](const friction_site& one) {
      return one.where == friction_site::place::edge && one.tendon == tendon && one.first_mover == joint;
    });
    if (site == rig->sites.end()) {
      node.member("joint").refuse("a joint where the finger's tendon has an edge_friction");
    }
    if (node.member("shape").absent()) {
      node.member("shape").refuse("\"sine\" or \"capstan\"");
    }
    diversion turn;
    const bool sine = choice_in(node, "shape", {"sine", "capstan"}) == 0;
    turn.shape = sine                                         ? diversion::form::sine
                 : rig->friction.loss == tension_loss::linear ? diversion::form::capstan_share
                                                              : diversion::form::capstan_exponent;
    turn.rest = number_in(node, "rest", any_angle, 0.0);
    turn.slope = number_in(node, "slope", {-10.0, 10.0, ""}, 1.0);
    turn.centre = number_in(node, "centre", any_angle, 0.0);
    turn.coefficient = number_in(node, "coefficient", {0.0, 10.0, ""});
    turn.negative_coefficient = number_in(node, "negative_coefficient", {0.0, 10.0, ""}, turn.coefficient);
    const law& shape = site->friction.laws.front();
    // of the description's law, before the rig made it one-sided
    turn.normal = 0.5 * (shape.positive.sliding / (1.0 + asymmetry) + shape.negative.sliding / (1.0 - asymmetry));
    if (turn.normal <= 0.0) {
      node.refuse("an edge whose first law has coulomb friction, to which the shape is scaled");
    }
    site->turn = turn;
  }
}

/* Slowly moving wrist: every tendon rubs there before it reaches the finger. */
void read_wrist(const json_node& physics, double asymmetry, rig* rig) {
  const json_node node = physics.member("wrist");
  if (node.absent()) {
    return;
  }
  node.expect_keys({"amplitude", "period", "arms", "friction", "presliding"});
  rig->wrist.amplitude = number_in(node, "amplitude", {0.0, 10.0, "rad"});
  rig->wrist.period = number_in(node, "period", {0.01, 1e6, "s"});
  rig->wrist.arms = numbers_in(node, "arms", rig->tendon_count(), any_length, false);
  node.member("friction").expect_keys({"static", "coulomb", "stribeck_velocity", "viscous"});
  friction_site site;
  site.where = friction_site::place::wrist;
  site.friction.laws.push_back(read_law(node.member("friction"), asymmetry));
  site.inverse_length = 1.0 / number_in(node, "presliding", {0.0, 1.0, "m", true}, 40e-6);
  for (std::size_t i = 0; i < rig->tendon_count(); ++i) {
    site.tendon = i;
    rig->sites.push_back(site);
  }
}

/* Sites of one tendon in the order in which it passes them, and how many it has passed at each joint. */
void read_tendon_sites(const json_node& tendon_node, std::size_t i, const presliding& distance, double asymmetry,
                       bool pulley_turns_joint, bool all_load, rig* rig, std::vector<friction_site>* sites) {
  const std::size_t n = rig->joint_count();
  tendon& tendon = rig->tendons[i];
  const json_node edges = tendon_node.member("edge_friction"), pulleys = tendon_node.member("pulley_friction");
  tendon.first_site = sites->size();
  for (const friction_site& wrist : rig->sites) {
    if (wrist.tendon == i) {
      sites->push_back(wrist);
    }
  }
  std::size_t last_moved = 0;
  for (std::size_t j = 0; j < n; ++j) {
    const moment_arm& arm = tendon.arms[j];
    if (arm.mean != 0.0 || arm.slope != 0.0 || arm.eccentricity != 0.0) {
      last_moved = j;
    }
  }
  for (std::size_t j = 0; j < n; ++j) {
    if (!edges.element(j).absent()) {
      // before joint 1 nothing bends: q0 = 0
      sites->push_back({friction_site::place::edge,
                        i,
                        j,
                        j > 0,
                        j > 0 ? j - 1 : 0,
                        read_laws(edges.element(j), asymmetry),
                        {},
                        1.0 / distance.edge});
    }
    const std::size_t after_edge = sites->size() - tendon.first_site;
    if (j + 1 < n && !pulleys.element(j).absent()) {
      sites->push_back({friction_site::place::pulley,
                        i,
                        j + 1,
                        false,
                        0,
                        read_laws(pulleys.element(j), asymmetry),
                        {},
                        1.0 / distance.pulley});
    }
    const std::size_t after_pulley = sites->size() - tendon.first_site;
    tendon.sites_before_torque.push_back(pulley_turns_joint ? after_pulley : after_edge);
    tendon.sites_before_load.push_back(after_edge);
    tendon.loads.push_back(all_load || j <= last_moved);
  }
  tendon.site_count = sites->size() - tendon.first_site;
}

void read_joint_sites(const json_node& joints, double distance, double asymmetry, rig* rig) {
  for (std::size_t j = 0; j < rig->joint_count(); ++j) {
    for (const bool by_load : {false, true}) {
      const json_node node = joints.element(j).member(by_load ? "load_friction" : "friction");
      if (!node.absent()) {
        rig->joint_sites.push_back({j, by_load, read_law(node, asymmetry), 1.0 / distance});
      }
    }
  }
}

}  // namespace

void read_friction(const json_node& finger, const json_node& physics, rig* rig) {
  const json_node node = physics.member("friction");
  node.expect_keys_if_present({"presliding", "bristle_damping", "stribeck_exponent", "tension_loss", "pulley_torque",
                               "joint_load", "preload", "asymmetry", "edges", "drift", "heat"});
  friction_settings& settings = rig->friction;
  const presliding distance = read_presliding(node);
  settings.bristle_damping = number_in(node, "bristle_damping", {0.0, 10.0, "s"}, 0.0);
  settings.stribeck_exponent = static_cast<int>(index_in(node, "stribeck_exponent", 1, 2, 1));
  settings.loss =
      choice_in(node, "tension_loss", {"linear", "capstan"}) == 0 ? tension_loss::linear : tension_loss::capstan;
  const bool at_joint = choice_in(node, "pulley_torque", {"beyond_joint", "at_joint"}) == 1;
  const bool all_load = choice_in(node, "joint_load", {"all", "passing"}) == 0;
  settings.preload = number_in(node, "preload", {0.0, 1e4, "N"}, 0.0);
  const double asymmetry = number_in(node, "asymmetry", {-0.9, 0.9, ""}, 0.0);

  const json_node drift = node.member("drift"), heat = node.member("heat");
  drift.expect_keys_if_present({"amplitude", "time_constant"});
  heat.expect_keys_if_present({"coefficient", "time_constant"});
  settings.drift_amplitude = number_in(drift, "amplitude", {-0.9, 10.0, ""}, 0.0);
  settings.drift_time = number_in(drift, "time_constant", {0.0, 1e9, "s", true}, 300.0);
  settings.heat_coefficient = number_in(heat, "coefficient", {-10.0, 10.0, "1/J"}, 0.0);
  settings.heat_time = number_in(heat, "time_constant", {0.0, 1e9, "s", true}, 100.0);

  read_wrist(physics, asymmetry, rig);
  std::vector<friction_site> sites;
  for (std::size_t i = 0; i < rig->tendon_count(); ++i) {
    read_tendon_sites(finger.member("tendons").element(i), i, distance, asymmetry, at_joint, all_load, rig, &sites);
  }
  rig->sites = sites;
  read_joint_sites(finger.member("joints"), distance.joint, asymmetry, rig);
  read_diversions(node, asymmetry, rig);
}

}  // namespace tendonfmu::plant
