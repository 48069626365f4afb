// A finger with every optional key of the detection: kernels, states, refused samples, parameters in contact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "model_inside.h"

using test_finger::Finger;
using test_finger::joints;
using test_finger::Motion;
using test_finger::Outputs;
using test_finger::tendons;

namespace {

constexpr std::size_t samples = 4000;

const Motion& motion() {
  static const Motion m(samples);
  return m;
}

const std::vector<unsigned char>& image() {
  static const std::vector<unsigned char> bytes = test_finger::image(test_finger::every_key());
  return bytes;
}

Outputs run(tendonfmu_finger* finger, std::size_t from = 0, std::size_t to = samples) {
  Outputs outputs(to - from);
  const tendonfmu_outputs view = outputs.view();
  const tendonfmu_inputs inputs = motion().row(from);
  EXPECT_EQ(tendonfmu_run(finger, to - from, &motion().time[from], &inputs, &view, nullptr), TENDONFMU_OK)
      << tendonfmu_last_error(finger);
  return outputs;
}

const Outputs& whole_run() {
  static const Outputs outputs = [] {
    Finger finger(image());
    return run(finger);
  }();
  return outputs;
}

template <typename Number>
bool ends_with(const std::vector<Number>& whole, const std::vector<Number>& rest) {
  return rest.size() <= whole.size() && std::equal(rest.rbegin(), rest.rend(), whole.rbegin());
}

bool continues(const Outputs& whole, const Outputs& rest) {
  return ends_with(whole.compensated, rest.compensated) && ends_with(whole.bias, rest.bias) &&
         ends_with(whole.deviation, rest.deviation) && ends_with(whole.residual, rest.residual) &&
         ends_with(whole.innovation, rest.innovation) && ends_with(whole.stuck, rest.stuck) &&
         ends_with(whole.jump, rest.jump) && ends_with(whole.parts, rest.parts) &&
         ends_with(whole.tip_force, rest.tip_force) && ends_with(whole.misfit, rest.misfit) &&
         ends_with(whole.joint_contact, rest.joint_contact) && ends_with(whole.link, rest.link);
}

double largest(const std::vector<double>& row) {
  return *std::max_element(row.begin(), row.end());
}

TEST(DetectionKeys, AllOfThemActInTheMotion) {
  const Outputs& o = whole_run();
  const auto in_contact = std::count(o.contact.begin(), o.contact.end(), 1);
  EXPECT_GT(in_contact, 100);
  EXPECT_LT(in_contact, 2000);
  EXPECT_GT(largest(o.stuck), 1e-3);
  EXPECT_GT(largest(o.jump), 1e-3);
  EXPECT_GT(largest(o.innovation), 1e-3);
  EXPECT_GT(largest(o.misfit) + largest(o.tip_std), 0.0);
  EXPECT_GT(std::count(o.link.begin(), o.link.end(), 0), 1000);
  EXPECT_GT(*std::max_element(o.link.begin(), o.link.end()), 0);
  for (const double deviation : o.deviation) {
    ASSERT_GE(deviation, 0.002);
  }
}

TEST(DetectionKeys, AllKernelsGiveTheSameBits) {
  for (int source = 1; source <= 3; ++source) {
    Finger plain(image());
    ASSERT_EQ(tendonfmu_set_kernel(plain, "plain"), TENDONFMU_OK);
    tendonfmu_set_kinematics_source(plain, source);
    const Outputs expected = run(plain);
    int compared = 0;
    for (const char* name : {"sse2", "avx2", "auto"}) {
      Finger other(image());
      if (tendonfmu_set_kernel(other, name) != TENDONFMU_OK) {
        continue;
      }
      tendonfmu_set_kinematics_source(other, source);
      EXPECT_TRUE(run(other) == expected) << name << ", source " << source;
      EXPECT_EQ(other.saved(), plain.saved()) << name;
      ++compared;
    }
    EXPECT_GE(compared, 1);
  }
}

/* a cut in contact, one in the hold after it, one while stuck, one just after the first sample */
std::vector<std::size_t> cuts() {
  const Outputs& o = whole_run();
  std::vector<std::size_t> at = {1, 1300, samples - 1};
  for (std::size_t k = 1; k < samples; ++k) {
    if (o.contact[k] && !o.contact[k - 1]) {
      at.push_back(k + 3);
    }
    if (!o.contact[k] && o.contact[k - 1]) {
      at.push_back(k - 5);
    }
  }
  return at;
}

TEST(DetectionKeys, RestoredAnywhereItContinuesBitForBit) {
  std::size_t in_contact = 0;
  const std::vector<std::size_t> all = cuts();
  ASSERT_GE(all.size(), 6u);
  for (std::size_t i = 0; i < all.size(); i += 1 + all.size() / 12) {
    const std::size_t cut = all[i];
    Finger first(image()), second(image());
    run(first, 0, cut);
    in_contact += whole_run().contact[cut - 1];
    run(second, 0, 2100); /* a history of its own */
    const auto bytes = first.saved();
    ASSERT_EQ(tendonfmu_restore_state(second, bytes.data(), bytes.size()), TENDONFMU_OK);
    EXPECT_TRUE(continues(whole_run(), run(second, cut))) << cut;
  }
  EXPECT_GT(in_contact, 1u);
}

TEST(DetectionKeys, OtherKernelsAndTheSameParametersLeaveNoTrace) {
  Finger finger(image());
  const char* const kernels[] = {"plain", "sse2", "avx2"};
  for (std::size_t k = 0; k < samples; k += 100) {
    tendonfmu_set_kernel(finger, kernels[k / 100 % 3]);
    EXPECT_EQ(tendonfmu_set_parameter(finger, "contact.uncertainty[1,2,2]", 0.1), TENDONFMU_OK);
    const Outputs part = run(finger, k, k + 100);
    ASSERT_TRUE(std::equal(part.stuck.begin(), part.stuck.end(), &whole_run().stuck[k * joints])) << k;
    ASSERT_TRUE(std::equal(part.deviation.begin(), part.deviation.end(), &whole_run().deviation[k * joints])) << k;
  }
}

TEST(DetectionKeys, ResetGivesTheFingerOfTheImage) {
  Finger fresh(image()), used(image());
  run(used, 0, 1900);
  tendonfmu_set_parameter(used, "contact.release_time", 9.0);
  ASSERT_EQ(tendonfmu_reset(used), TENDONFMU_OK);
  EXPECT_EQ(used.saved(), fresh.saved());
  EXPECT_TRUE(run(used) == whole_run());
}

TEST(DetectionKeys, ReleaseTimeWrittenInContactCountsFromItsBeginning) {
  const Outputs& o = whole_run();
  std::size_t start = 1;
  while (start + 60 < samples && !(o.contact[start] && o.contact[start + 59] && !o.contact[start - 1])) {
    ++start;
  }
  ASSERT_LT(start + 60, samples);
  Finger finger(image());
  run(finger, 0, start + 40);
  ASSERT_EQ(tendonfmu_set_parameter(finger, "contact.release_time", 0.0395), TENDONFMU_OK);
  const auto bytes = finger.saved();
  const Outputs released = run(finger, start + 40, start + 41);
  ASSERT_EQ(tendonfmu_restore_state(finger, bytes.data(), bytes.size()), TENDONFMU_OK);
  ASSERT_EQ(tendonfmu_set_parameter(finger, "contact.release_time", 0.0405), TENDONFMU_OK);
  const Outputs held = run(finger, start + 40, start + 41);
  EXPECT_EQ(held.compensated[0], held.residual[0]); /* no update: T_eff is as it was */
  EXPECT_NE(released.compensated[0], released.residual[0]);
}

/* --- samples that overflow ------------------------------------------------------------------------------------------
 */

struct Step {
  double time, first, second; /* joint angles */
};

tendonfmu_status take(tendonfmu_finger* finger, const Step& step) {
  const double force[tendons] = {15.0, 17.0, 12.0}, angle[joints] = {step.first, step.second};
  const tendonfmu_inputs inputs = {force, nullptr, angle, nullptr};
  return tendonfmu_is_initialised(finger) ? tendonfmu_step(finger, step.time, &inputs)
                                          : tendonfmu_initialise(finger, step.time, &inputs);
}

// The side on which stiction holds is that of the last sample taken, whatever was refused since.
TEST(DetectionKeys, RefusedSampleLeavesStictionAsItWas) {
  double stuck[2][joints];
  for (int refuse = 0; refuse < 2; ++refuse) {
    Finger finger(image());
    tendonfmu_set_kinematics_source(finger, TENDONFMU_JOINT_POSITIONS);
    ASSERT_EQ(tendonfmu_set_parameter(finger, "velocity_filter_cutoff", 0.0), TENDONFMU_OK);
    for (const Step& step : {Step{-3.0, 0.0, 0.0}, Step{-2.0, 0.2, 0.2}, Step{0.0, 0.2, 0.2}}) {
      ASSERT_EQ(take(finger, step), TENDONFMU_OK);
    }
    const auto before = finger.saved();
    if (refuse) {
      ASSERT_EQ(take(finger, {5e-324, 0.1, 0.1}), TENDONFMU_BAD_SAMPLE);
      EXPECT_EQ(finger.saved(), before);
    }
    ASSERT_EQ(take(finger, {1.0, 0.2, 0.2}), TENDONFMU_OK);
    tendonfmu_outputs view = {};
    view.stuck_friction = stuck[refuse];
    ASSERT_EQ(tendonfmu_get_outputs(finger, &view), TENDONFMU_OK);
  }
  EXPECT_GT(stuck[0][1], 0.0);
  EXPECT_EQ(stuck[1][0], stuck[0][0]);
  EXPECT_EQ(stuck[1][1], stuck[0][1]);
}

// Torques whose squares overflow are refused, those below leave finite outputs and a state that restores. (The
// uncertainty would overflow first.)
TEST(DetectionKeys, NoVarianceOverflows) {
  std::string text = test_finger::every_key();
  const std::size_t begin = text.find("\"uncertainty\":"), end = text.find("\"deviation\":");
  ASSERT_LT(begin, end);
  const auto certain = test_finger::image(text.erase(begin, end - begin));
  int taken = 0, refused = 0;
  for (double exponent = 10.0; exponent < 308.0; exponent += 2.0) {
    Finger finger(certain);
    tendonfmu_set_kinematics_source(finger, TENDONFMU_JOINT_POSITIONS);
    ASSERT_EQ(tendonfmu_set_parameter(finger, "velocity_filter_cutoff", 0.0), TENDONFMU_OK);
    ASSERT_EQ(take(finger, {0.0, 0.3, 0.3}), TENDONFMU_OK);
    const tendonfmu_status status = take(finger, {std::pow(10.0, -exponent), 0.0, 0.0});
    status == TENDONFMU_OK ? ++taken : ++refused;
    Outputs o(1);
    const tendonfmu_outputs view = o.view();
    ASSERT_EQ(tendonfmu_get_outputs(finger, &view), TENDONFMU_OK);
    for (const auto* row : {&o.compensated, &o.deviation, &o.jump, &o.stuck, &o.tip_force, &o.tip_std, &o.misfit}) {
      for (const double x : *row) {
        ASSERT_TRUE(std::isfinite(x)) << exponent;
      }
    }
    const auto bytes = finger.saved();
    EXPECT_EQ(tendonfmu_restore_state(finger, bytes.data(), bytes.size()), TENDONFMU_OK) << exponent;
  }
  EXPECT_GT(taken, 5);
  EXPECT_GT(refused, 5);
}

/* --- saved states under a checksum that fits ------------------------------------------------------------------------
 */

struct Damage {
  const char* what;
  const double* number; /* of the finger whose state is damaged */
  double value;
};

TEST(DetectionKeys, StateWithANumberThatCannotBeIsRefused) {
  Finger finger(image());
  run(finger, 0, 1900);
  const auto good = finger.saved();
  const finger_state& s = finger.handle->remembered;
  const Damage damages[] = {
      {"negative variance", s.variance, -1e-9},
      {"variance that overflows", s.variance + 1, 1e308},
      {"negative total variance", s.total_variance + 1, -1e-30},
      {"gain above 1", s.gain, 1.5},
      {"half a contact", s.joint_contact, 0.5},
      {"contact without a joint", s.joint_contact + joints, 1.0},
      {"residual without a joint", s.bias + joints, 1.0},
      {"negative H", s.stuck_friction, -1.0},
      {"negative J", s.friction_jump, -1.0},
      {"J that overflows", s.friction_jump, 1e200},
      {"negative evidence", s.evidence, -1e-3},
      {"exceeded in no time", s.exceeded_at, 1e16},
      {"contact since no time", s.scalar + STATE_CONTACT_SINCE, -1e300},
      {"negative absorption", s.scalar + STATE_ABSORBED, -1.0},
      {"more absorbed before than now", s.scalar + STATE_ABSORBED_BEFORE, s.scalar[STATE_ABSORBED] + 1.0},
      {"rest that begins after it ends", s.stuck_since, s.scalar[STATE_ABSORBED] + 1.0},
      {"third side", s.side, 2.0},
      {"side without a tendon", s.side + tendons, 1.0},
      {"half an open start", s.scalar + STATE_START_OPEN, 0.5},
      {"negative V", s.unlearned, -1e-3},
      {"more of the start than all", s.start_left, 1.5},
      {"drift that overflows", s.drift, 1e200},
      {"not a number", s.entry_pulley, std::numeric_limits<double>::quiet_NaN()},
      {"infinite part", s.part, std::numeric_limits<double>::infinity()},
  };
  const std::size_t state = 40 + 8 * tendonfmu_parameter_count(finger);
  for (const Damage& damage : damages) {
    auto bad = good;
    store_f64(&bad[state + 8 * static_cast<std::size_t>(damage.number - finger.handle->state)], damage.value);
    store_u64(&bad[24], hash_bytes(&bad[32], bad.size() - 32, 0));
    EXPECT_EQ(tendonfmu_restore_state(finger, bad.data(), bad.size()), TENDONFMU_BAD_STATE) << damage.what;
    EXPECT_EQ(finger.saved(), good) << damage.what;
  }
  EXPECT_EQ(tendonfmu_restore_state(finger, good.data(), good.size()), TENDONFMU_OK);
}

/* --- model images ---------------------------------------------------------------------------------------------------
 */

TEST(DetectionKeys, WrittenAgainTheImageIsTheSameBytes) {
  const Model model(image());
  ASSERT_TRUE(model.accepted) << model.message;
  EXPECT_EQ(model.written(), image());
}

TEST(DetectionKeys, OptionsThatDoNotGoTogetherAreRefused) {
  const std::uint32_t options = Model(image()).shape.options;
  ASSERT_EQ(options & MODEL_UNCERTAINTY_DIRECTIONS, 2u << 10);
  const auto refused_with = [&](std::uint32_t bits) {
    auto damaged = image();
    store_u32(&damaged[40], bits);
    store_u64(&damaged[24], hash_bytes(&damaged[32], damaged.size() - 32, 0));
    return tendonfmu_check_image(damaged.data(), damaged.size(), nullptr, 0) == TENDONFMU_BAD_IMAGE;
  };
  EXPECT_FALSE(refused_with(options));
  EXPECT_TRUE(refused_with(options & ~std::uint32_t{MODEL_HAS_UNCERTAINTY}));
  EXPECT_TRUE(refused_with(options | MODEL_UNCERTAINTY_DIRECTIONS)); /* seven directions */
  EXPECT_TRUE(refused_with(options & ~std::uint32_t{MODEL_DETECTS_BY_INNOVATION}));
  EXPECT_TRUE(refused_with(options | std::uint32_t{MODEL_HAS_REST_INNOVATION})); /* without rest */
  EXPECT_TRUE(refused_with(options | (MODEL_OPTION_BITS + 1u)));
}

// Every bit of the options, under a right checksum: refused, or a finger that takes samples.
TEST(DetectionKeys, OptionBitsFlippedAreRefusedWhereNumbersDoNotFit) {
  for (unsigned bit = 0; bit < 32; ++bit) {
    auto damaged = image();
    store_u32(&damaged[40], load_u32(&damaged[40]) ^ 1u << bit);
    store_u64(&damaged[24], hash_bytes(&damaged[32], damaged.size() - 32, 0));
    tendonfmu_finger* finger = tendonfmu_create(damaged.data(), damaged.size(), nullptr, 0);
    const bool only_a_word = bit == 4 || bit == 5 || bit == 22; /* forgetting, entry_load, stuck_presliding */
    EXPECT_EQ(finger != nullptr, only_a_word) << bit;
    if (finger) {
      run(finger, 0, 1500);
    }
    tendonfmu_destroy(finger);
  }
}

}  // namespace
