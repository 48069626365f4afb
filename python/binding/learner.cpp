// The sample-by-sample filter (tendonfmu_learner.h) in the Python module _estimation.
#include "estimation_arrays.h"

namespace {

class bound_learner : bound_handle<tendonfmu_learner, tendonfmu_learner_destroy, tendonfmu_learner_last_error> {
 public:
  bound_learner(const nb::bytes& image, const std::optional<group_row>& group, const std::optional<number_row>& scale,
                double prior_std, std::size_t block, double parameter_drift)
      : bound_handle([&](char* message, std::size_t size) {
          const tendonfmu_learner_options options{prior_std, block, parameter_drift};
          expect_all_numbers(image, group, scale);
          return tendonfmu_learner_create(image.data(), image.size(), group ? group->data() : nullptr,
                                          scale ? scale->data() : nullptr, &options, message, size);
        }) {}

  std::size_t joints() const { return tendonfmu_learner_joint_count(get()); }
  std::size_t tendons() const { return tendonfmu_learner_tendon_count(get()); }
  std::size_t unknowns() const { return tendonfmu_learner_unknown_count(get()); }
  std::size_t parameters() const { return tendonfmu_learner_parameter_count(get()); }
  std::size_t slack_samples() const { return tendonfmu_learner_slack_samples(get()); }

  nb::tuple unknown(std::size_t index) const {
    tendonfmu_unknown u;
    expect(tendonfmu_learner_get_unknown(get(), index, &u));
    return as_tuple(u);
  }

  // innovation and variance [N, n], samples taken; watch(samples_done, samples) -> bool
  nb::tuple run(const number_row& time, const number_rows& force, const std::optional<number_rows>& position,
                const std::optional<number_rows>& angle, const std::optional<number_rows>& velocity, int source,
                const std::optional<number_rows>& external, const std::optional<flag_row>& use,
                const nb::object& watch) {
    const sample_arrays rows{time, force, position, angle, velocity, external, use};
    rows.check(joints(), tendons());
    const std::size_t samples = time.shape(0), n = joints();
    const tendonfmu_inputs inputs = rows.inputs();
    auto [innovation, innovations] = new_array<double>({samples, n});
    auto [variance, variances] = new_array<double>({samples, n});
    std::size_t done = 0;
    python_watch watching(watch);
    tendonfmu_status status;
    {
      const nb::gil_scoped_release without_gil;
      status = tendonfmu_learner_run(get(), samples, time.data(), &inputs, source, data(external),
                                     use ? use->data() : nullptr, innovations, variances, &look, &watching, &done);
    }
    watching.rethrow();
    expect(status);
    return nb::make_tuple(innovation, variance, done);
  }

  void begin_pass() { expect(tendonfmu_learner_begin_pass(get())); }

  nb::tuple values() const {
    auto [values, numbers] = new_array<double>({parameters()});
    auto [errors, standard_errors] = new_array<double>({parameters()});
    expect(tendonfmu_learner_get_values(get(), numbers, standard_errors));
    return nb::make_tuple(values, errors);
  }

  nb::object z() const {
    auto [z, values] = new_array<double>({unknowns()});
    expect(tendonfmu_learner_get_unknowns(get(), values, nullptr));
    return z;
  }

  nb::object covariance() const {
    auto [covariance, values] = new_array<double>({unknowns(), unknowns()});
    expect(tendonfmu_learner_get_unknowns(get(), nullptr, values));
    return covariance;
  }

  nb::tuple bias() const {
    auto [bias, values] = new_array<double>({joints()});
    auto [errors, standard_errors] = new_array<double>({joints()});
    expect(tendonfmu_learner_get_bias(get(), values, standard_errors));
    return nb::make_tuple(bias, errors);
  }

 private:
  static int look(void* context, std::size_t done, std::size_t samples) {
    return static_cast<python_watch*>(context)->ask([&] { return nb::make_tuple(done, samples); });
  }
};

}  // namespace

void bind_learner(nb::module_& m) {
  nb::class_<bound_learner>(m, "Learner")
      .def(nb::init<const nb::bytes&, const std::optional<group_row>&, const std::optional<number_row>&, double,
                    std::size_t, double>(),
           nb::arg("image"), nb::arg("group") = nb::none(), nb::arg("scale") = nb::none(), nb::arg("prior_std") = 1.0,
           nb::arg("block") = 8, nb::arg("parameter_drift") = 0.0)
      .def_prop_ro("joints", &bound_learner::joints)
      .def_prop_ro("tendons", &bound_learner::tendons)
      .def_prop_ro("unknown_count", &bound_learner::unknowns)
      .def_prop_ro("slack_samples", &bound_learner::slack_samples)
      .def("unknown", &bound_learner::unknown)
      .def("run", &bound_learner::run, nb::arg("time"), nb::arg("tendon_force"),
           nb::arg("tendon_position") = nb::none(), nb::arg("joint_position") = nb::none(),
           nb::arg("joint_velocity") = nb::none(), nb::arg("kinematics_source") = 1,
           nb::arg("external_torque") = nb::none(), nb::arg("use") = nb::none(), nb::arg("watch") = nb::none())
      .def("begin_pass", &bound_learner::begin_pass)
      .def("values", &bound_learner::values)
      .def("z", &bound_learner::z)
      .def("covariance", &bound_learner::covariance)
      .def("bias", &bound_learner::bias);
}
