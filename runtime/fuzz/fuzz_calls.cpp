// A byte string drives a sequence of calls. A call that fails changes nothing and says why; after one that succeeds all
// outputs are finite.
#include <fuzzer/FuzzedDataProvider.h>

#include <cstdint>
#include <string>

#include "promises.h"

extern "C" {
#include "bytes.h"
}

namespace {

using promises::byte_list;

const char* const one_joint = R"({"format": "tendonfmu-finger-1", "name": "one",
  "joints": [{"friction": {"static": 0.004, "coulomb": 0.003, "stribeck_velocity": 0.1}}],
  "tendons": [{"stiffness": 4000, "moment_arms": [0.01]}],
  "bias": {"noise_time": 0.01, "noise_std": 0, "initial_variance": 0, "initial_torque": [0.1]},
  "contact": {"threshold": [0.03], "deviation": [0.002]}, "links": [{"axis": [0, 1, 0.5]}], "tip": [0.04, 0, 0]})";

class call_session {
 public:
  call_session(FuzzedDataProvider& data, const byte_list& image)
      : data_(data),
        finger_(tendonfmu_create(image.data(), image.size(), nullptr, 0)),
        spare_(tendonfmu_create(image.data(), image.size(), nullptr, 0)) {
    PROMISE(finger_ != nullptr && spare_ != nullptr);
    kept_ = promises::saved(finger_);
  }
  ~call_session() {
    tendonfmu_destroy(finger_);
    tendonfmu_destroy(spare_);
  }
  call_session(const call_session&) = delete;
  call_session& operator=(const call_session&) = delete;

  void call() {
    const byte_list before = promises::saved(finger_);
    rows_taken_ = 0;
    const tendonfmu_status status = one_call();
    if (status != TENDONFMU_OK) {
      promises::is_one_line(tendonfmu_last_error(finger_));
      PROMISE(rows_taken_ > 0 || promises::saved(finger_) == before);
    }
    if (tendonfmu_is_initialised(finger_)) {
      promises::outputs_are_finite(finger_);
    }
  }

 private:
  tendonfmu_status one_call() {
    switch (data_.ConsumeIntegralInRange(0, 13)) {
      case 0: return first_sample();
      case 1: return tendonfmu_reset(finger_);
      case 2: return with_sound_parameters(write_parameters(finger_));
      case 3: return write_one_parameter();
      case 4: kept_ = promises::saved(finger_); return TENDONFMU_OK;
      case 5: return tendonfmu_restore_state(finger_, kept_.data(), kept_.size());
      case 6: return restore_damaged();
      case 7: return run();
      case 8: return derive();
      case 9: return tendonfmu_set_kinematics_source(finger_, data_.ConsumeIntegralInRange(-1, 5));
      case 10: return choose_kernel();
      case 11: return take_prepared();
      default: return step();
    }
  }

  double number() {
    const double odd[] = {0.0,  -0.0, 5e-324, -1e-300, 1.0,    1e9,      1e12,      -1e12,
                          1e13, 1e15, 1e300,  1e308,   -1e308, HUGE_VAL, -HUGE_VAL, NAN};
    switch (data_.ConsumeIntegralInRange(0, 7)) {
      case 0: return data_.PickValueInArray(odd);
      case 1: return data_.ConsumeFloatingPoint<double>();
      case 2: return data_.ConsumeFloatingPointInRange(-1e3, 1e3);
      default: return data_.ConsumeFloatingPointInRange(-1.0, 1.0);
    }
  }

  std::vector<double> row(std::size_t count, double scale) {
    std::vector<double> values(count);
    for (double& x : values) {
      x = scale * number();
    }
    return values;
  }

  // inputs of some samples, in vectors that live until the next call
  tendonfmu_inputs inputs(std::size_t samples) {
    const std::size_t n = tendonfmu_joint_count(finger_), m = tendonfmu_tendon_count(finger_);
    force_ = row(samples * m, 30.0);
    position_ = row(samples * m, 0.01);
    angle_ = row(samples * n, 1.0);
    velocity_ = row(samples * n, 1.0);
    const auto some = [&](const std::vector<double>& v) {
      return data_.ConsumeIntegralInRange(0, 31) == 0 ? nullptr : v.data();
    };
    return {some(force_), some(position_), some(angle_), some(velocity_)};
  }

  double later() { return tendonfmu_get_time(finger_) + 0.01 * std::abs(number()); }

  tendonfmu_status first_sample() {
    const tendonfmu_inputs sample = inputs(1);
    return tendonfmu_initialise(finger_, number(), &sample);
  }

  tendonfmu_status step() {
    const tendonfmu_inputs sample = inputs(1);
    return tendonfmu_step(finger_, data_.ConsumeIntegralInRange(0, 15) ? later() : number(), &sample);
  }

  tendonfmu_status run() {
    const std::size_t samples = data_.ConsumeIntegralInRange<std::size_t>(0, 5);
    const tendonfmu_inputs all = inputs(samples);
    std::vector<double> time(samples + 1, later());
    for (std::size_t k = 1; k <= samples; ++k) {
      time[k] = time[k - 1] + 0.01 * number();
    }
    promises::output_room outputs(finger_, samples);
    const tendonfmu_outputs view = outputs.view();
    const tendonfmu_status status = tendonfmu_run(finger_, samples, time.data(), &all, &view, &rows_taken_);
    PROMISE(rows_taken_ <= samples);
    PROMISE((status == TENDONFMU_OK) == (rows_taken_ == samples));
    outputs.check(); /* rows not taken are zeros */
    return status;
  }

  tendonfmu_status write_parameters(tendonfmu_finger* finger) {
    std::vector<std::size_t> indices(data_.ConsumeIntegralInRange<std::size_t>(0, 4));
    for (std::size_t& index : indices) {
      index = data_.ConsumeIntegralInRange<std::size_t>(0, tendonfmu_parameter_count(finger));
    }
    const std::vector<double> values = row(indices.size(), 1.0);
    return tendonfmu_set_parameters(finger, indices.size(), indices.data(), values.data());
  }

  // of the spare, whose last call may have been refused
  tendonfmu_status take_prepared() {
    write_parameters(spare_);
    return with_sound_parameters(tendonfmu_take_parameters(finger_, spare_));
  }

  tendonfmu_status write_one_parameter() {
    char path[80] = "";
    const std::size_t index = data_.ConsumeIntegralInRange<std::size_t>(0, 2 * tendonfmu_parameter_count(finger_));
    const bool known = tendonfmu_get_parameter_path(finger_, index, path, sizeof path) == TENDONFMU_OK;
    const std::string any = known ? path : data_.ConsumeRandomLengthString(100);
    return with_sound_parameters(tendonfmu_set_parameter(finger_, any.c_str(), number()));
  }

  // a saved state with some bytes changed, half the time under a checksum that fits
  tendonfmu_status restore_damaged() {
    byte_list bytes = kept_;
    for (int i = data_.ConsumeIntegralInRange(1, 4); i > 0; --i) {
      if (data_.ConsumeBool()) {
        bytes[data_.ConsumeIntegralInRange<std::size_t>(0, bytes.size() - 1)] = data_.ConsumeIntegral<unsigned char>();
      } else {
        store_f64(&bytes[8 * data_.ConsumeIntegralInRange<std::size_t>(5, bytes.size() / 8 - 1)],
                  data_.ConsumeBool() ? number() : data_.PickValueInArray({1e308, -1e308, 5e-324}));
      }
    }
    if (data_.ConsumeBool()) {
      store_u64(&bytes[24], hash_bytes(&bytes[32], bytes.size() - 32, 0));
    }
    return with_sound_parameters(tendonfmu_restore_state(finger_, bytes.data(), bytes.size()));
  }

  tendonfmu_status with_sound_parameters(tendonfmu_status status) {
    if (status == TENDONFMU_OK) {
      promises::parameters_are_sound(finger_);
    }
    return status;
  }

  tendonfmu_status derive() {
    const tendonfmu_inputs direction = inputs(1);
    promises::output_room derivative(finger_, 1);
    const tendonfmu_outputs view = derivative.view();
    return tendonfmu_get_directional_derivative(finger_, &direction, &view);
  }

  tendonfmu_status choose_kernel() {
    const char* const names[] = {"plain", "sse2", "avx2", "auto", "", "avx"};
    return tendonfmu_set_kernel(finger_, data_.PickValueInArray(names));
  }

  FuzzedDataProvider& data_;
  tendonfmu_finger *finger_, *spare_;
  byte_list kept_;
  std::vector<double> force_, position_, angle_, velocity_;
  std::size_t rows_taken_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  static const byte_list image_of_one_joint = test_finger::image(one_joint);
  FuzzedDataProvider data(bytes, size);
  const int which = data.ConsumeIntegralInRange<int>(0, test_finger::kinds);
  call_session session(data, which < test_finger::kinds ? test_finger::image_of(which) : image_of_one_joint);
  while (data.remaining_bytes() > 0) {
    session.call();
  }
  return 0;
}
