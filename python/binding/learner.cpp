// The sample-by-sample filter (tendonfmu_learner.h) in the Python module _estimation.
#include "estimation_arrays.h"

namespace {

class bound_learner {
 public:
  bound_learner(const nb::bytes& image, const std::optional<group_row>& group, const std::optional<number_row>& scale,
                double prior_std, std::size_t block, double parameter_drift) {
    const tendonfmu_learner_options options{prior_std, block, parameter_drift};
    expect_all_numbers(image, group, scale);
    create(image, group ? group->data() : nullptr, scale ? scale->data() : nullptr, options);
  }

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
    std::vector<double> innovation(samples * n), variance(samples * n);
    std::size_t done = 0;
    python_watch watching(watch);
    tendonfmu_status status;
    {
      const nb::gil_scoped_release without_gil;
      status = tendonfmu_learner_run(get(), samples, time.data(), &inputs, source, data(external),
                                     use ? use->data() : nullptr, innovation.data(), variance.data(), &look, &watching,
                                     &done);
    }
    watching.rethrow();
    expect(status);
    return nb::make_tuple(as_array(std::move(innovation), {samples, n}), as_array(std::move(variance), {samples, n}),
                          done);
  }

  void begin_pass() { expect(tendonfmu_learner_begin_pass(get())); }

  nb::tuple values() const {
    std::vector<double> values(parameters()), errors(parameters());
    expect(tendonfmu_learner_get_values(get(), values.data(), errors.data()));
    return nb::make_tuple(as_array(std::move(values), {parameters()}), as_array(std::move(errors), {parameters()}));
  }

  nb::object z() const {
    std::vector<double> z(unknowns());
    expect(tendonfmu_learner_get_unknowns(get(), z.data(), nullptr));
    return as_array(std::move(z), {unknowns()});
  }

  nb::object covariance() const {
    std::vector<double> covariance(unknowns() * unknowns());
    expect(tendonfmu_learner_get_unknowns(get(), nullptr, covariance.data()));
    return as_array(std::move(covariance), {unknowns(), unknowns()});
  }

  nb::tuple bias() const {
    std::vector<double> bias(joints()), errors(joints());
    expect(tendonfmu_learner_get_bias(get(), bias.data(), errors.data()));
    return nb::make_tuple(as_array(std::move(bias), {joints()}), as_array(std::move(errors), {joints()}));
  }

 private:
  struct learner_deleter {
    void operator()(tendonfmu_learner* l) const { tendonfmu_learner_destroy(l); }
  };

  static int look(void* context, std::size_t done, std::size_t samples) {
    return static_cast<python_watch*>(context)->ask([&] { return nb::make_tuple(done, samples); });
  }

  void create(const nb::bytes& image, const std::int32_t* group, const double* scale,
              const tendonfmu_learner_options& options) {
    char message[600] = "";
    learner_.reset(
        tendonfmu_learner_create(image.data(), image.size(), group, scale, &options, message, sizeof message));
    if (!learner_) {
      throw nb::value_error(message);
    }
  }
  tendonfmu_learner* get() const { return learner_.get(); }
  void expect(tendonfmu_status status) const {
    if (status != TENDONFMU_OK) {
      throw nb::value_error(tendonfmu_learner_last_error(get()));
    }
  }

  std::unique_ptr<tendonfmu_learner, learner_deleter> learner_;
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
