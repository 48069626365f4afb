// The public interface as a control loop and a simulator use it: promises that every finger keeps, and refusals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "model_inside.h"

using test_finger::Finger;
using test_finger::image_of;
using test_finger::joints;
using test_finger::Motion;
using test_finger::Outputs;
using test_finger::tendons;

namespace {

constexpr std::size_t samples = 4000;
constexpr double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();

const Motion& motion() {
  static const Motion m(samples);
  return m;
}

// the force of tendon 2 fails now and then
const Motion& failing() {
  static const Motion m = [] {
    Motion made(samples);
    made.let_force_fail(1);
    return made;
  }();
  return m;
}

void set(tendonfmu_finger* finger, const char* path, double value) {
  ASSERT_EQ(tendonfmu_set_parameter(finger, path, value), TENDONFMU_OK) << tendonfmu_last_error(finger);
}

tendonfmu_status restore(tendonfmu_finger* finger, const std::vector<unsigned char>& bytes) {
  return tendonfmu_restore_state(finger, bytes.data(), bytes.size());
}

template <class Number>
std::size_t count(const std::vector<Number>& row, int value) {
  return static_cast<std::size_t>(std::count(row.begin(), row.end(), value));
}

// --- promises of every finger, by every source of kinematics ---------------------------------------------------------

class EveryFinger : public testing::TestWithParam<std::tuple<int, int>> {
 protected:
  const std::vector<unsigned char>& image() const { return image_of(std::get<0>(GetParam())); }
  int source() const { return std::get<1>(GetParam()); }
  const Motion& motion() const { return std::get<0>(GetParam()) == test_finger::watching ? failing() : ::motion(); }
};
INSTANTIATE_TEST_SUITE_P(Kinds, EveryFinger,
                         testing::Combine(testing::Range<int>(0, test_finger::kinds), testing::Values(1, 2, 3)));

TEST_P(EveryFinger, GivesTheSameBitsWithAllKernels) {
  Finger plain(image());
  ASSERT_EQ(tendonfmu_set_kernel(plain, "plain"), TENDONFMU_OK);
  tendonfmu_set_kinematics_source(plain, source());
  const Outputs expected = plain.run(motion());
  Finger automatic(image());
  ASSERT_EQ(tendonfmu_set_kernel(automatic, "auto"), TENDONFMU_OK);
  EXPECT_EQ(tendonfmu_get_kernel(automatic), std::string(test_finger::kernels().back()));
  for (const char* kernel : test_finger::kernels()) {
    Finger other(image());
    tendonfmu_set_kernel(other, kernel);
    tendonfmu_set_kinematics_source(other, source());
    EXPECT_TRUE(other.run(motion()) == expected) << kernel;
    EXPECT_EQ(other.saved(), plain.saved()) << kernel;
  }
}

TEST_P(EveryFinger, TakesSamplesOneByOneAsARunDoes) {
  Finger batch(image()), single(image());
  for (const Finger* finger : {&batch, &single}) {
    tendonfmu_set_kinematics_source(*finger, source());
  }
  const Outputs expected = batch.run(motion());
  Outputs one(1);
  const tendonfmu_outputs view = one.view();
  for (std::size_t k = 0; k < samples; ++k) {
    ASSERT_EQ(single.take(motion().time[k], motion().row(k)), TENDONFMU_OK);
    ASSERT_EQ(tendonfmu_get_outputs(single, &view), TENDONFMU_OK);
    for (const auto& [name, row] : one.real) {
      ASSERT_TRUE(std::equal(row.begin(), row.end(), &expected.real.at(name)[k * row.size()])) << name << " " << k;
    }
    ASSERT_EQ(one.flag.at("contact")[0], expected.flag.at("contact")[k]);
  }
  EXPECT_EQ(single.saved(), batch.saved());
}

// A finger that has gone elsewhere takes up what another one has left: just begun, in motion, with a sensor that fails,
// at rest, in contact, in the hold after it, at the end.
TEST_P(EveryFinger, GoesOnFromASavedStateWithTheSameBits) {
  Finger whole(image()), other(image());
  tendonfmu_set_kinematics_source(whole, source());
  tendonfmu_set_kinematics_source(other, source() % 3 + 1);
  other.run(motion(), 0, 2100);
  const std::size_t cuts[] = {1, 7, 700, 1100, 1250, 1850, 1995, 2010, 2600, 3900, samples};
  whole.run(motion(), 0, cuts[0]);
  for (std::size_t i = 0; i + 1 < std::size(cuts); ++i) {
    ASSERT_EQ(restore(other, whole.saved()), TENDONFMU_OK) << tendonfmu_last_error(other);
    EXPECT_TRUE(whole.run(motion(), cuts[i], cuts[i + 1]) == other.run(motion(), cuts[i], cuts[i + 1])) << cuts[i];
    EXPECT_EQ(whole.saved(), other.saved()) << cuts[i];
  }
}

// what was remembered, for another source too, and parameters
TEST_P(EveryFinger, IsThatOfTheImageAfterAReset) {
  Finger fresh(image()), used(image());
  tendonfmu_set_kinematics_source(used, source());
  used.run(motion(), 0, 1900);
  set(used, "contact.threshold[1]", 9.0);
  ASSERT_EQ(tendonfmu_reset(used), TENDONFMU_OK);
  for (const Finger* finger : {&fresh, &used}) {
    tendonfmu_set_kinematics_source(*finger, source() % 3 + 1);
  }
  EXPECT_EQ(used.saved(), fresh.saved());
  EXPECT_TRUE(used.run(motion()) == fresh.run(motion()));
}

TEST_P(EveryFinger, RefusesADamagedStateAndChangesNothing) {
  Finger finger(image());
  tendonfmu_set_kinematics_source(finger, source());
  finger.run(motion(), 0, 500);
  const auto good = finger.saved();
  finger.run(motion(), 500, 600);
  const auto before = finger.saved();
  for (std::size_t at = 0; at < good.size(); at += 13) {
    auto bad = good;
    bad[at] ^= 0x20;
    EXPECT_EQ(restore(finger, bad), TENDONFMU_BAD_STATE) << at;
    EXPECT_STRNE(tendonfmu_last_error(finger), "");
  }
  EXPECT_EQ(tendonfmu_restore_state(finger, good.data(), good.size() - 1), TENDONFMU_BAD_STATE);
  EXPECT_EQ(finger.saved(), before);
}

TEST_P(EveryFinger, RefusesBadSamplesByNameAndGoesOnAsIfTheyHadNotBeen) {
  Finger finger(image()), quiet(image());
  for (const Finger* each : {&finger, &quiet}) {
    tendonfmu_set_kinematics_source(*each, source());
    each->run(motion(), 0, 100);
  }
  const auto before = finger.saved();
  const auto refused = [&](double time, const tendonfmu_inputs& inputs, const std::string& name) {
    EXPECT_EQ(finger.take(time, inputs), TENDONFMU_BAD_SAMPLE);
    EXPECT_EQ(std::string(tendonfmu_last_error(finger)).find(name), 0u) << tendonfmu_last_error(finger);
    EXPECT_EQ(finger.saved(), before);
  };
  for (const double bad : {nan, inf, -inf, 1e13}) {
    for (std::size_t i = 0; i < tendons; ++i) {
      Motion broken = motion();
      broken.force[100 * tendons + i] = bad;
      refused(0.1, broken.row(100), "tendon_force[" + std::to_string(i + 1) + "]");
    }
    Motion broken = motion();
    broken.position[100 * tendons + 2] = broken.angle[100 * joints + 1] = bad;
    const bool by_tendons = source() == 1 || tendonfmu_watches_motors(finger);
    refused(0.1, broken.row(100), by_tendons ? "tendon_position[3]" : "joint_position[2]");
  }
  for (const double time : {nan, inf, 0.0989, -1.0}) {
    refused(time, motion().row(100), "time");
  }
  EXPECT_EQ(finger.take(motion().time[99], motion().row(1700)), TENDONFMU_OK) << "the same time again: nothing";
  EXPECT_TRUE(finger.run(motion(), 100, 1000) == quiet.run(motion(), 100, 1000));
}

// --- the motion of the tests ----------------------------------------------------------------------------------------

TEST(Motion, MovesRestsTouchesReversesAndLetsEveryKeyAct) {
  const Outputs plain = Finger().run(motion()), o = Finger(image_of(test_finger::detecting)).run(motion());
  const std::vector<double>& speed = plain.real.at("joint_speed");
  const auto share = [&](auto is) { return 1.0 / samples * std::count_if(speed.begin(), speed.end(), is); };
  EXPECT_GT(share([](double v) { return v > 0.5; }), 0.1);
  EXPECT_GT(share([](double v) { return v < -0.5; }), 0.1);
  EXPECT_GT(share([](double v) { return std::fabs(v) < 0.02; }), 0.1);
  for (const Outputs* outputs : {&plain, &o}) {
    EXPECT_GT(count(outputs->flag.at("contact"), 1), samples / 50);
    EXPECT_LT(count(outputs->flag.at("contact"), 1), 3 * samples / 4);
  }
  for (const char* name : {"residual", "contact_level", "fingertip_force_std"}) {
    EXPECT_GT(*std::max_element(o.real.at(name).begin(), o.real.at(name).end()), 1e-3) << name;
  }
  EXPECT_GT(count(o.whole.at("contact_link"), 0), 1000u);
  EXPECT_LT(count(o.whole.at("contact_link"), 0), samples);
  EXPECT_EQ(tendonfmu_watches_sensors(Finger(image_of(test_finger::detecting))), 0);
  EXPECT_EQ(tendonfmu_watches_sensors(Finger(image_of(test_finger::watching))), 1);
  const Outputs watched = Finger(image_of(test_finger::watching)).run(failing());
  EXPECT_EQ(watched.flag.at("sensor_fault")[1200 * tendons + 1], 1);
  EXPECT_EQ(watched.flag.at("contact_observable")[1200], 0);
  EXPECT_EQ(watched.flag.at("contact_observable")[1500], 1) << "it has recovered";
}

// --- one finger alone -----------------------------------------------------------------------------------------------

TEST(Finger, StatesBringTheirParametersAndFitTheirFingerAlone) {
  Finger tuned, plain;
  set(tuned, "joints[1].friction.coulomb", 0.001);
  ASSERT_EQ(restore(plain, tuned.saved()), TENDONFMU_OK);
  double value = 0.0;
  ASSERT_EQ(tendonfmu_get_parameter(plain, "joints[1].friction.coulomb", &value), TENDONFMU_OK);
  EXPECT_EQ(value, 0.001);
  EXPECT_TRUE(plain.run(motion()) == tuned.run(motion()));
  std::string text = test_finger::json;
  text.replace(text.find("0.008, 0.006"), 12, "0.009, 0.006");
  EXPECT_EQ(restore(plain, Finger(test_finger::image(text)).saved()), TENDONFMU_BAD_STATE);
}

TEST(Finger, RefusedRowOfABatchIsNamedAndRowsBeforeItAreWritten) {
  Motion broken(200);
  broken.force[150 * tendons + 1] = nan;
  Finger finger;
  Outputs outputs(200);
  const tendonfmu_outputs view = outputs.view();
  const tendonfmu_inputs inputs = broken.all();
  std::size_t done = 0;
  EXPECT_EQ(tendonfmu_run(finger, 200, broken.time.data(), &inputs, &view, &done), TENDONFMU_BAD_SAMPLE);
  EXPECT_EQ(done, 150u);
  EXPECT_TRUE(std::isfinite(view.compensated_torque[149 * joints]));
  EXPECT_TRUE(std::isnan(view.compensated_torque[150 * joints]));
}

TEST(Finger, MissingArgumentsAreRefusedInWords) {
  Finger finger;
  EXPECT_EQ(tendonfmu_initialise(finger, 0.0, nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("missing"), std::string::npos);
  EXPECT_EQ(tendonfmu_set_parameter(finger, nullptr, 1.0), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_step(nullptr, 0.0, nullptr), TENDONFMU_BAD_ARGUMENT);
  tendonfmu_set_kinematics_source(finger, 2);
  tendonfmu_inputs inputs = motion().row(0);
  inputs.joint_position = nullptr;
  EXPECT_EQ(finger.take(0.0, inputs), TENDONFMU_BAD_SAMPLE);
  EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("joint_position is missing"), std::string::npos);
}

TEST(Finger, OrderOfCallsIsHeld) {
  Finger finger;
  const tendonfmu_inputs inputs = motion().row(0);
  double torque[joints];
  tendonfmu_outputs view = {};
  view.joint_torque = torque;
  EXPECT_EQ(tendonfmu_step(finger, 0.0, &inputs), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_get_outputs(finger, &view), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_get_directional_derivative(finger, &inputs, &view), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_OK);
  EXPECT_EQ(tendonfmu_initialise(finger, 0.0, &inputs), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_set_kinematics_source(finger, 2), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_set_parameter(finger, "tendons[1].stiffness", 1000.0), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_set_parameter(finger, "tendons[1].pulley_friction[1].coulomb", 0.01), TENDONFMU_OK);
}

TEST(Finger, PlacedAtAnyAddressItBehavesTheSame) {
  const auto bytes = test_finger::image();
  Finger created(bytes);
  const Outputs expected = created.run(motion());
  const std::size_t size = tendonfmu_memory_size(bytes.data(), bytes.size());
  std::vector<unsigned char> memory(size + 64);
  char message[200];
  for (const std::size_t shift : {0, 1, 7, 33}) {
    tendonfmu_finger* placed =
        tendonfmu_place(memory.data() + shift, size, bytes.data(), bytes.size(), message, sizeof message);
    ASSERT_NE(placed, nullptr) << message;
    Outputs outputs(samples);
    const tendonfmu_outputs view = outputs.view();
    const tendonfmu_inputs inputs = motion().all();
    ASSERT_EQ(tendonfmu_run(placed, samples, motion().time.data(), &inputs, &view, nullptr), TENDONFMU_OK);
    EXPECT_TRUE(outputs == expected);
  }
  EXPECT_EQ(tendonfmu_place(memory.data(), size - 1, bytes.data(), bytes.size(), message, sizeof message), nullptr);
  EXPECT_NE(std::string(message).find("too little memory"), std::string::npos);
}

TEST(Finger, ParametersAreWrittenAllOrNone) {
  Finger finger;
  const std::size_t fs = tendonfmu_find_parameter(finger, "joints[1].friction.static");
  const std::size_t fc = tendonfmu_find_parameter(finger, "joints[1].friction.coulomb");
  const std::size_t both[] = {fs, fc};
  const double raised[] = {0.02, 0.015}, crossed[] = {0.01, 0.015}, negative[] = {0.02, -1.0};
  const auto before = finger.saved();
  EXPECT_EQ(tendonfmu_set_parameters(finger, 2, both, crossed), TENDONFMU_BAD_PARAMETER);
  EXPECT_NE(std::string(tendonfmu_last_error(finger)).find("at least coulomb"), std::string::npos);
  EXPECT_EQ(tendonfmu_set_parameters(finger, 2, both, negative), TENDONFMU_BAD_PARAMETER);
  EXPECT_EQ(tendonfmu_set_parameter(finger, "joints[1].friction.static", nan), TENDONFMU_BAD_PARAMETER);
  EXPECT_EQ(tendonfmu_set_parameter(finger, "joints[9].friction.static", 1.0), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(finger.saved(), before);
  EXPECT_EQ(tendonfmu_set_parameters(finger, 2, both, raised), TENDONFMU_OK);
  EXPECT_NE(finger.saved(), before);
}

// --- derivatives ----------------------------------------------------------------------------------------------------

// A motion of one sample: sample k of the tests' moved by `step` along a direction of its own, or that direction.
Motion sample_along(std::size_t k, double step, bool direction_alone = false) {
  Motion one(1);
  const auto move = [&](std::vector<double>& row, const std::vector<double>& from, double scale, double phase) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      const double along = scale * std::sin(phase + static_cast<double>(i * 3 + k));
      row[i] = direction_alone ? along : from[k * row.size() + i] + step * along;
    }
  };
  move(one.force, motion().force, 1.0, 1.0);
  move(one.position, motion().position, 1e-3, 2.0);
  move(one.angle, motion().angle, 0.1, 3.0);
  move(one.velocity, motion().velocity, 1.0, 4.0);
  return one;
}

// Central differences on samples whose branches both neighbours share.
TEST(Finger, DirectionalDerivativeMatchesCentralDifferences) {
  const double h = 1e-6;
  for (int source = 1; source <= 3; ++source) {
    Finger finger;
    tendonfmu_set_kinematics_source(finger, source);
    std::size_t checked = 0;
    for (std::size_t k = 0; k < samples; ++k) {
      const double time = motion().time[k];
      if (k % 37 != 5) {
        ASSERT_EQ(finger.take(time, motion().row(k)), TENDONFMU_OK);
        continue;
      }
      const auto before = finger.saved();
      Outputs side[2] = {Outputs(1), Outputs(1)}, slope(1);
      for (const int s : {0, 1}) {
        ASSERT_EQ(finger.take(time, sample_along(k, s ? h : -h).all()), TENDONFMU_OK);
        const tendonfmu_outputs view = side[s].view();
        tendonfmu_get_outputs(finger, &view);
        ASSERT_EQ(restore(finger, before), TENDONFMU_OK);
      }
      ASSERT_EQ(finger.take(time, motion().row(k)), TENDONFMU_OK);
      const Motion along = sample_along(k, 0.0, true);
      const tendonfmu_inputs direction = along.all();
      const tendonfmu_outputs view = slope.view();
      ASSERT_EQ(tendonfmu_get_directional_derivative(finger, &direction, &view), TENDONFMU_OK);
      if (side[0].flag.at("contact") != side[1].flag.at("contact")) {
        continue;
      }
      ++checked;
      for (const char* name :
           {"compensated_torque", "joint_torque", "friction_torque", "bias_torque", "joint_angle", "joint_speed"}) {
        for (std::size_t j = 0; j < joints; ++j) {
          const double numeric = (side[1].real.at(name)[j] - side[0].real.at(name)[j]) / (2.0 * h);
          EXPECT_NEAR(slope.real.at(name)[j], numeric, 1e-6 + 2e-4 * std::abs(numeric))
              << name << ", sample " << k << ", source " << source;
        }
      }
    }
    EXPECT_GT(checked, 90u);
  }
}

// --- which working points are in force at a joint angle -------------------------------------------------------------

// edge before joint 2: tendon 1 has working points at −0.5, 0.1, 0.6 rad, tendon 2 has no friction there
TEST(SlotSegment, CountsTheWorkingPointsAtOrBelowTheAngle) {
  const Finger finger;
  const auto segment = [&](std::size_t tendon, double angle) { return slot_segment(finger, 1, tendon, angle); };
  EXPECT_EQ(segment(0, -0.6), 0u);
  EXPECT_EQ(segment(0, -0.5), 1u); /* a working point begins its segment */
  EXPECT_EQ(segment(0, 0.0999), 1u);
  EXPECT_EQ(segment(0, 0.1), 2u);
  EXPECT_EQ(segment(0, 0.6), 3u);
  // a joint angle overflows before the sample is refused: no law beyond those of the edge may be read
  EXPECT_EQ(segment(0, inf), 3u);
  EXPECT_EQ(segment(0, -inf), 0u);
  for (const double angle : {inf, -inf, nan}) {
    EXPECT_EQ(segment(1, angle), 0u);
  }
}

// --- saved states and images under a checksum that fits -------------------------------------------------------------

struct Damage {
  const char* what;
  const double* number; /* of the finger whose state is damaged */
  double value;
};

void expect_refused(const Finger& finger, const std::vector<Damage>& damages) {
  const auto good = finger.saved();
  const std::size_t state = 40 + 8 * tendonfmu_parameter_count(finger);
  for (const Damage& damage : damages) {
    auto bad = good;
    store_f64(&bad[state + 8 * static_cast<std::size_t>(damage.number - finger.handle->state)], damage.value);
    seal(bad);
    EXPECT_EQ(restore(finger, bad), TENDONFMU_BAD_STATE) << damage.what;
    EXPECT_EQ(finger.saved(), good) << damage.what;
  }
  EXPECT_EQ(restore(finger, good), TENDONFMU_OK);
}

TEST(Memory, LacksWhatTheFingerHasNot) {
  const Finger finger;
  const finger_state& s = finger.handle->remembered;
  const finger_scratch& o = finger.handle->scratch;
  const derived_numbers& d = finger.handle->derived;
  for (const double* row : {s.bands, s.sensor.fault, s.watch, s.element, s.tension, s.extension, o.limit,
                            o.sensor.fault, o.own_limit, o.tension, d.band_square, d.links.axis}) {
    EXPECT_EQ(row, nullptr);
  }
}

TEST(SavedState, WithANumberThatCannotBeIsRefused) {
  Finger finger(image_of(test_finger::detecting));
  finger.run(motion(), 0, 1900);
  const finger_state& s = finger.handle->remembered;
  expect_refused(finger, {{"negative variance", s.variance, -1e-9},
                          {"variance that overflows", s.variance + 1, 1e308},
                          {"negative total variance", s.total_variance + 1, -1e-30},
                          {"gain above 1", s.gain, 1.5},
                          {"half a contact", s.joint_contact, 0.5},
                          {"contact without a joint", s.joint_contact + joints, 1.0},
                          {"residual without a joint", s.bias + joints, 1.0},
                          {"negative level", s.level, -1.0},
                          {"begun in the future", &bands_of(finger.handle, 0)->begun_at, 1e6},
                          {"touched in the future", &bands_of(finger.handle, 0)->touched_at, 1e6},
                          {"change that overflows", bands_of(finger.handle, 0)->mean, 1e200},
                          {"negative absorption", s.scalar + STATE_ABSORBED, -1.0},
                          {"more absorbed before", s.scalar + STATE_ABSORBED_BEFORE, s.scalar[STATE_ABSORBED] + 1.0},
                          {"rest that begins after it ends", s.stuck_since, s.scalar[STATE_ABSORBED] + 1.0},
                          {"unwell without sensor_fault", s.scalar + STATE_UNWELL, 1.0},
                          {"scalar that is none", s.scalar + STATE_SCALARS - 1, 1.0},
                          {"third side", s.side, 2.0},
                          {"side without a tendon", s.side + tendons, 1.0},
                          {"jumps that overflow", s.jumped, 1e200}});
}

TEST(SavedState, OfWatchedSensorsWithANumberThatCannotBeIsRefused) {
  Finger finger(image_of(test_finger::watching));
  finger.run(failing());
  const finger_state& s = finger.handle->remembered;
  expect_refused(finger, {{"third fault", s.sensor.fault, 3.0},
                          {"fault without a tendon", s.sensor.fault + 3, 1.0},
                          {"half known", s.sensor.known, 0.5},
                          {"fault since no time", s.sensor.fault_since, 1e16},
                          {"not a number", s.sensor.taut_force + 1, nan},
                          {"third watch", s.watch, 3.0},
                          {"twice unwell", finger.handle->state + STATE_UNWELL, 2.0}});
}

std::vector<unsigned char> with_options(std::uint32_t bits) {
  auto image = image_of(test_finger::detecting);
  store_u32(&image[40], bits);
  seal(image);
  return image;
}

TEST(Options, ThatDoNotGoTogetherAreRefused) {
  const std::uint32_t options = Model(image_of(test_finger::detecting)).shape.options;
  const auto refused_with = [&](std::uint32_t bits) {
    const auto image = with_options(bits);
    tendonfmu_finger* made = tendonfmu_create(image.data(), image.size(), nullptr, 0);
    tendonfmu_destroy(made);
    return made == nullptr;
  };
  EXPECT_FALSE(refused_with(options));
  EXPECT_TRUE(refused_with(options & ~std::uint32_t{MODEL_DETECTS_BY_BANDS})); /* watches motors for nothing */
  EXPECT_TRUE(refused_with(options | (MODEL_OPTION_BITS + 1u)));
  // every bit: refused where the numbers do not fit, or a finger that takes samples
  for (unsigned bit = 0; bit < 32; ++bit) {
    const bool only_a_word = bit == 4 || bit == 6; /* forgetting, watches_motors */
    EXPECT_EQ(refused_with(options ^ 1u << bit), !only_a_word) << bit;
    if (only_a_word) {
      Finger(with_options(options ^ 1u << bit)).run(motion(), 0, 1500);
    }
  }
}

// --- sensors that fail ----------------------------------------------------------------------------------------------

TEST(SensorFault, ARowLeavesAndComesBackExactly) {
  Finger finger(image_of(test_finger::watching));
  const std::vector<double> whole(finger.handle->derived.inverse_routing,
                                  finger.handle->derived.inverse_routing + joints * finger.handle->tendon_lanes);
  const double* inverse = finger.handle->scratch.inverse_routing;
  double fault[4] = {};
  fault[1] = FORCE_FAILS;
  use_rows(finger.handle, fault);
  EXPECT_EQ(finger.handle->scratch.angles_determined, 1);
  for (std::size_t j = 0; j < joints; ++j) {
    for (std::size_t k = 0; k < joints; ++k) { /* R⁺ R = 1 without that row */
      double product = 0.0;
      for (std::size_t i = 0; i < tendons; ++i) {
        const std::size_t lanes = finger.handle->tendon_lanes;
        product += inverse[j * lanes + i] * finger.handle->derived.moment_arm[k * lanes + i];
      }
      EXPECT_NEAR(product, j == k ? 1.0 : 0.0, 1e-12);
    }
    EXPECT_EQ(inverse[j * finger.handle->tendon_lanes + 1], 0.0);
  }
  fault[0] = POSITION_FAILS; /* both of a pair */
  use_rows(finger.handle, fault);
  EXPECT_EQ(finger.handle->scratch.angles_determined, 0);
  recall_sample(finger.handle);
  EXPECT_TRUE(std::equal(whole.begin(), whole.end(), inverse));
}

}  // namespace
