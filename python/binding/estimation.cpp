// The C interface of the estimation as the Python module _estimation: numpy arrays in and out.
#include <algorithm>

#include "estimation_arrays.h"

namespace {

class bound_estimator : bound_handle<tendonfmu_estimator, tendonfmu_estimator_destroy, tendonfmu_estimator_last_error> {
 public:
  bound_estimator(const nb::bytes& image, const std::optional<group_row>& group, const std::optional<number_row>& scale)
      : bound_handle([&](char* message, std::size_t size) {
          expect_all_numbers(image, group, scale);
          return tendonfmu_estimator_create(image.data(), image.size(), group ? group->data() : nullptr,
                                            scale ? scale->data() : nullptr, message, size);
        }) {}

  std::size_t joints() const { return tendonfmu_estimator_joint_count(get()); }
  std::size_t tendons() const { return tendonfmu_estimator_tendon_count(get()); }
  std::size_t unknowns() const { return tendonfmu_estimator_unknown_count(get()); }
  std::size_t parameters() const { return tendonfmu_estimator_parameter_count(get()); }

  nb::tuple unknown(std::size_t index) const {
    tendonfmu_unknown u;
    expect(tendonfmu_estimator_get_unknown(get(), index, &u));
    return as_tuple(u);
  }

  nb::object values(const number_row& z) const {
    expect_unknowns(z);
    auto [array, values] = new_array<double>({parameters()});
    expect(tendonfmu_estimator_get_values(get(), z.data(), values));
    return array;
  }

  nb::object unknown_values(const number_row& values) const {
    check_length(values.shape(0), "values");
    auto [array, z] = new_array<double>({unknowns()});
    expect(tendonfmu_estimator_get_unknowns(get(), values.data(), z));
    return array;
  }

  std::size_t add_recording(const number_row& time, const number_rows& force,
                            const std::optional<number_rows>& position, const std::optional<number_rows>& angle,
                            const std::optional<number_rows>& velocity, int source,
                            const std::optional<number_rows>& external, const std::optional<flag_row>& use) {
    const sample_arrays samples{time, force, position, angle, velocity, external, use};
    samples.check(joints(), tendons());
    const tendonfmu_inputs inputs = samples.inputs();
    std::size_t index = 0;
    expect(tendonfmu_estimator_add_recording(get(), time.shape(0), time.data(), &inputs, source, data(external),
                                             use ? use->data() : nullptr, &index));
    lengths_.push_back(time.shape(0));
    return index;
  }

  void set_weights(std::size_t recording, const number_row& weight) {
    if (weight.shape(0) != joints()) {
      throw nb::value_error(("weight: expected " + std::to_string(joints()) + " numbers, one a joint").c_str());
    }
    expect(tendonfmu_estimator_set_weights(get(), recording, weight.data()));
  }

  void set_known(const number_rows& information) {
    if (information.shape(0) != unknowns() || information.shape(1) != unknowns()) {
      throw nb::value_error("information: expected a row and a column for each unknown");
    }
    expect(tendonfmu_estimator_set_known(get(), information.data()));
  }

  nb::tuple evaluate(const number_row& z, std::size_t stride, unsigned threads) const {
    expect_unknowns(z);
    const std::size_t u = unknowns();
    double cost = 0.0;
    auto [gradient, slopes] = new_array<double>({u});
    auto [information, rows] = new_array<double>({u, u});
    tendonfmu_status status;
    {
      const nb::gil_scoped_release without_gil;
      status = tendonfmu_estimator_evaluate(get(), z.data(), stride, threads, &cost, slopes, rows);
    }
    expect(status);
    return nb::make_tuple(cost, gradient, information);
  }

  nb::tuple jacobian(std::size_t recording, const number_row& z, std::size_t first, std::size_t count,
                     std::size_t length) const {
    expect_unknowns(z);
    const std::size_t u = unknowns(), n = joints();
    auto [torque, torques] = new_array<double>({count, n});
    auto [jump, jumps] = new_array<double>({count, n});
    auto [torque_derivative, torque_slopes] = new_array<double>({count, n, u});
    auto [jump_derivative, jump_slopes] = new_array<double>({count, n, u});
    expect(tendonfmu_estimator_jacobian(get(), recording, z.data(), first, count, length, torques, jumps, torque_slopes,
                                        jump_slopes));
    return nb::make_tuple(torque, jump, torque_derivative, jump_derivative);
  }

  nb::tuple innovations(std::size_t recording, const number_row& z) const {
    expect_unknowns(z);
    const std::size_t samples = recording < lengths_.size() ? lengths_[recording] : 0, n = joints();
    auto [innovation, innovations] = new_array<double>({samples, n});
    auto [variance, variances] = new_array<double>({samples});
    auto [bias, biases] = new_array<double>({samples, n});
    expect(tendonfmu_estimator_innovations(get(), recording, z.data(), innovations, variances, biases));
    return nb::make_tuple(innovation, variance, bias);
  }

  // watch(pass, stride, samples_done, samples, cost, best) -> bool
  nb::dict fit(const number_row& start, double prior_std, double tolerance, std::size_t passes, std::size_t stride,
               unsigned threads, const nb::object& watch) const {
    expect_unknowns(start);
    const std::size_t u = unknowns();
    auto [z, best] = new_array<double>({u});
    auto [gradient, slopes] = new_array<double>({u});
    auto [information, rows] = new_array<double>({u, u});
    auto [covariance, covariances] = new_array<double>({u, u});
    tendonfmu_fit_result result{best, slopes, rows, covariances, 0, 0, 0, 0, 0, 0};
    const tendonfmu_fit_options options{prior_std, tolerance, passes, stride, threads};
    fit_watch watching{python_watch(watch), u};
    tendonfmu_status status;
    {
      const nb::gil_scoped_release without_gil;
      status = tendonfmu_estimator_fit(get(), start.data(), &options, &fit_watch::call, &watching, &result);
    }
    watching.watch.rethrow();
    expect(status);
    nb::dict fitted;
    fitted["z"] = z;
    fitted["gradient"] = gradient;
    fitted["information"] = information;
    fitted["covariance"] = covariance;
    fitted["cost"] = result.cost;
    fitted["prior_cost"] = result.prior_cost;
    fitted["passes"] = result.passes;
    fitted["steps"] = result.steps;
    fitted["converged"] = result.converged != 0;
    fitted["stopped"] = result.stopped != 0;
    return fitted;
  }

 private:
  struct fit_watch {
    python_watch watch;
    std::size_t unknowns;

    static int call(void* context, const tendonfmu_fit_progress* p) {
      auto* self = static_cast<fit_watch*>(context);
      return self->watch.ask([&] {
        auto [best, values] = new_array<double>({self->unknowns});
        std::copy_n(p->best, self->unknowns, values);
        return nb::make_tuple(p->pass, p->stride, p->samples_done, p->samples, p->cost, best);
      });
    }
  };

  void expect_unknowns(const number_row& z) const {
    if (z.shape(0) != unknowns()) {
      throw nb::value_error(("z: expected " + std::to_string(unknowns()) + " unknowns").c_str());
    }
  }
  void check_length(std::size_t length, const char* name) const {
    if (length != parameters()) {
      throw nb::value_error((std::string(name) + ": expected " + std::to_string(parameters()) + " numbers").c_str());
    }
  }

  std::vector<std::size_t> lengths_;
};

}  // namespace

NB_MODULE(_estimation, m) {
  bind_learner(m);
  nb::class_<bound_estimator>(m, "Estimator")
      .def(nb::init<const nb::bytes&, const std::optional<group_row>&, const std::optional<number_row>&>(),
           nb::arg("image"), nb::arg("group") = nb::none(), nb::arg("scale") = nb::none())
      .def_prop_ro("joints", &bound_estimator::joints)
      .def_prop_ro("tendons", &bound_estimator::tendons)
      .def_prop_ro("unknown_count", &bound_estimator::unknowns)
      .def_prop_ro("parameter_count", &bound_estimator::parameters)
      .def("unknown", &bound_estimator::unknown)
      .def("values", &bound_estimator::values)
      .def("unknown_values", &bound_estimator::unknown_values)
      .def("add_recording", &bound_estimator::add_recording, nb::arg("time"), nb::arg("tendon_force"),
           nb::arg("tendon_position") = nb::none(), nb::arg("joint_position") = nb::none(),
           nb::arg("joint_velocity") = nb::none(), nb::arg("kinematics_source") = 1,
           nb::arg("external_torque") = nb::none(), nb::arg("use") = nb::none())
      .def("set_weights", &bound_estimator::set_weights, nb::arg("recording"), nb::arg("weight"))
      .def("set_known", &bound_estimator::set_known, nb::arg("information"))
      .def("evaluate", &bound_estimator::evaluate, nb::arg("z"), nb::arg("stride") = 1, nb::arg("threads") = 0)
      .def("jacobian", &bound_estimator::jacobian)
      .def("innovations", &bound_estimator::innovations)
      .def("fit", &bound_estimator::fit, nb::arg("start"), nb::arg("prior_std"), nb::arg("tolerance"),
           nb::arg("passes"), nb::arg("stride"), nb::arg("threads"), nb::arg("watch") = nb::none());
}
