#include "bench_finger.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <sstream>

#include "tendonfmu_description.h"

namespace bench_finger {
namespace {

double moment_arm(int tendon, int joint) {
  const double size = 0.009 - 0.0005 * joint + 0.0001 * tendon;
  return joint <= tendon / 2 ? (tendon % 2 == 0 ? size : -size) : 0.0;
}

double stiffness(int tendon) {
  return 4000.0 + 100.0 * tendon;
}

// A law whose numbers differ from those of every other place.
std::string law(double scale, double velocity, int place) {
  std::ostringstream s;
  const double vary = 1.0 + 0.01 * (place % 17);
  s << R"({"static": )" << 1.4 * scale * vary << R"(, "coulomb": )" << scale * vary << R"(, "stribeck_velocity": )"
    << velocity * (1.0 + 0.02 * (place % 11)) << R"(, "viscous": )" << 0.1 * scale << "}";
  return s.str();
}

std::string list(int count, const std::function<std::string(int)>& item) {
  std::string s = "[";
  for (int i = 0; i < count; ++i) {
    s += (i > 0 ? ", " : "") + item(i);
  }
  return s + "]";
}

std::string number(double x) {
  std::ostringstream s;
  s << x;
  return s.str();
}

std::string edge(int tendon, int joint, int points) {
  return R"({"angles": )" + list(points, [&](int k) { return number(-1.0 + 0.5 * k + 0.013 * tendon); }) +
         R"(, "laws": )" + list(points, [&](int k) { return law(0.02, 0.005, 7 * tendon + 3 * joint + k); }) + "}";
}

std::string tendon(int i, int joints, int points) {
  return R"({"stiffness": )" + number(stiffness(i)) + R"(, "moment_arms": )" +
         list(joints, [&](int j) { return number(moment_arm(i, j)); }) + R"(, "pulley_friction": )" +
         list(joints - 1, [&](int j) { return law(0.01, 0.004, i + 5 * j); }) + R"(, "edge_friction": )" +
         list(joints, [&](int j) { return edge(i, j, points); }) + "}";
}

made_recording record(int joints, int tendons, std::size_t samples, const std::function<double(int, double)>& angle) {
  made_recording r;
  for (std::size_t k = 0; k < samples; ++k) {
    const double t = 1e-3 * static_cast<double>(k);
    r.time.push_back(t);
    for (int i = 0; i < tendons; ++i) {
      double travel = 0.0;
      for (int j = 0; j < joints; ++j) {
        travel += moment_arm(i, j) * angle(j, t);
      }
      r.force.push_back(20.0 + i + 3.0 * std::sin(t + i));
      r.position.push_back(travel + r.force.back() / stiffness(i));
    }
  }
  return r;
}

// what `tendonfmu tune` and `fit` write: innovation, bounds, four directions of uncertainty a joint, releases
std::string detection_keys(int joints, int tendons, bool by_cusum) {
  const auto per_joint = [joints](const char* value) { return list(joints, [=](int) { return std::string(value); }); };
  const std::string direction = list(tendons + 3, [](int i) { return number(0.01 * (1 + i % 3)); });
  const std::string directions = list(4, [&](int) { return direction; });
  return std::string(R"(, "method": ")") + (by_cusum ? "cusum" : "innovation") + R"(", "innovation": {"time": 0.05, )" +
         R"("threshold": )" + per_joint("5") + R"(, "threshold_per_force": )" + per_joint("0.001") +
         (by_cusum ? R"(, "evidence_time": 0.01)" : "") + R"(}, "friction_bound": {"stuck_share": 0.4, )" +
         R"("jump_share": 0.6}, "uncertainty": )" + list(joints, [&](int) { return directions; }) +
         R"(, "deviation": )" + per_joint("0.002") + R"(, "release_ratio": 0.7, "hold_time": 0.05, "release_time": 2)";
}

// what it writes beside them: slow loads, contact at rest
std::string calibrated_keys(int joints) {
  const auto per_joint = [joints](const char* value) { return list(joints, [=](int) { return std::string(value); }); };
  return R"(, "drift": {"threshold": )" + per_joint("5") + R"(, "threshold_per_force": )" + per_joint("0.001") +
         R"(}, "rest": {"travel": 1e-5, "threshold": )" + per_joint("0.01") + R"(, "creep": )" + per_joint("0.001") +
         R"(, "innovation": {"time": 0.5, "threshold": )" + per_joint("0.01") + "}}";
}

std::string row(const char* effect, const char* key, int place, const char* numbers) {
  return std::string(R"({"effect": ")") + effect + "\", \"" + key + "\": " + std::to_string(place + 1) + ", " +
         numbers + "}";
}

std::string extension_rows(int joints, int tendons, key_choice keys) {
  std::vector<std::string> rows;
  const bool presliding = keys == key_choice::presliding || keys == key_choice::presliding_filtered;
  for (int j = 0; j < joints && keys == key_choice::torques; ++j) {
    rows.push_back(row("gravity", "joint", j, R"("sine": 0.01, "cosine": 0.01)"));
    rows.push_back(row("inertia", "joint", j, R"("inertia": 1e-5)"));
    rows.push_back(row("cover_hardening", "joint", j, R"("stiffness": 0.01)"));
  }
  for (int j = 0; j < joints && presliding; ++j) {
    rows.push_back(row("presliding", "joint", j, R"("displacement": 0.004)"));
  }
  for (int i = 0; i < tendons; ++i) {
    if (presliding) {
      rows.push_back(row("presliding", "tendon", i, R"("displacement": 4e-5)"));
    } else if (keys == key_choice::torques) {
      rows.push_back(row("force_gain", "tendon", i, R"("correction": 0.02)"));
    }
  }
  if (keys == key_choice::calibrated_presliding) {
    rows.push_back(R"({"effect": "presliding", "displacement": 0.05})");
  }
  if (keys == key_choice::delay) {
    rows.push_back(R"({"effect": "time_delay", "delay": 0.002})");
  }
  return list(static_cast<int>(rows.size()), [&](int k) { return rows[static_cast<std::size_t>(k)]; });
}

}  // namespace

std::string description(int joints, int tendons, int points, key_choice keys) {
  const bool everything = keys == key_choice::everything;
  const bool calibrated = keys == key_choice::calibrated || keys == key_choice::calibrated_presliding;
  const bool detects = everything || calibrated || keys == key_choice::innovation;
  const bool filtered = keys == key_choice::filtered || keys == key_choice::presliding_filtered;
  return R"({"format": "tendonfmu-finger-1", "name": "bench", "joints": )" +
         list(joints,
              [&](int j) {
                return R"({"cover": {"stiffness": 0.02}, "friction": )" + law(0.005, 0.1, j) +
                       R"(, "load_friction": )" + law(1e-4, 0.1, j + 3) + "}";
              }) +
         R"(, "tendons": )" + list(tendons, [&](int i) { return tendon(i, joints, points); }) +
         R"(, "contact": {"threshold": )" + list(joints, [](int) { return std::string("5"); }) +
         (detects ? detection_keys(joints, tendons, everything) : "") + (calibrated ? calibrated_keys(joints) : "") +
         R"(}, "extensions": )" + extension_rows(joints, tendons, keys) +
         (everything ? R"(, "velocity_threshold": {"hysteresis": 0.3}, "bias": {"forgetting": "absorption", )"
                       R"("entry_load": true})"
                     : "") +
         (calibrated ? R"(, "bias": {"start_share": 1, "noise_time": 0.001}, "sensor_fault": {})" : "") +
         (filtered ? R"(, "position_filter": {"noise": )" + list(joints, [](int) { return std::string("4e-4"); }) + "}"
                   : "") +
         "}";
}

std::vector<unsigned char> image(const std::string& json) {
  void* block = nullptr;
  std::size_t size = 0;
  char message[400];
  if (tendonfmu_image_from_json(json.data(), json.size(), &block, &size, message, sizeof message) != TENDONFMU_OK) {
    std::fprintf(stderr, "bench finger refused: %s\n", message);
    std::exit(2);
  }
  const auto* bytes = static_cast<const unsigned char*>(block);
  std::vector<unsigned char> copy(bytes, bytes + size);
  tendonfmu_free_image(block);
  return copy;
}

made_recording motion(int joints, int tendons, std::size_t samples) {
  return record(joints, tendons, samples,
                [](int j, double t) { return 0.8 * std::sin(t * (0.7 + 0.3 * j) + j) + 0.1 * std::sin(3.1 * t); });
}

made_recording shaking(int joints, int tendons, std::size_t samples) {
  return record(joints, tendons, samples, [](int j, double t) {
    const auto k = static_cast<long>(std::lround(1e3 * t));
    return (k % 4 < 2 ? 0.01 : -0.01) * (k % 2 == 0 ? 1.0 : 1.2) * (1 + j);
  });
}

}  // namespace bench_finger
