// The estimation (tendonfmu_estimation.hpp) as the Python module _estimation: numpy arrays in and out.
#include <nanobind/stl/unique_ptr.h>

#include "arrays.h"
#include "tendonfmu_estimation.hpp"

namespace {

using namespace tendonfmu::estimation;

using group_row = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

template <typename Value>
std::vector<Value> copied(
    const std::optional<nb::ndarray<const Value, nb::ndim<1>, nb::c_contig, nb::device::cpu>>& row) {
  return row ? std::vector<Value>(row->data(), row->data() + row->size()) : std::vector<Value>();
}

numbers copied(const number_row& row) {
  return {row.data(), row.data() + row.size()};
}

const double* data(const std::optional<number_rows>& rows) {
  return rows ? rows->data() : nullptr;
}

void expect_rows(const std::optional<number_rows>& rows, std::size_t samples, std::size_t columns, const char* name) {
  if (rows && (rows->shape(0) != samples || rows->shape(1) != columns)) {
    throw nb::value_error((std::string(name) + ": expected " + std::to_string(samples) + " rows of " +
                           std::to_string(columns) + " columns")
                              .c_str());
  }
}

// A recording of an estimator or a learner; the arrays must outlive it.
template <typename Finger>
recording_arrays recording_of(const Finger& finger, const number_row& time, const number_rows& force,
                              const std::optional<number_rows>& position, const std::optional<number_rows>& angle,
                              const std::optional<number_rows>& velocity, int source,
                              const std::optional<number_rows>& external, const std::optional<flag_row>& use) {
  const std::size_t count = time.shape(0), n = finger.joint_count(), m = finger.tendon_count();
  expect_rows(force, count, m, "tendon_force");
  expect_rows(position, count, m, "tendon_position");
  expect_rows(angle, count, n, "joint_position");
  expect_rows(velocity, count, n, "joint_velocity");
  expect_rows(external, count, n, "external_torque");
  if (use && use->shape(0) != count) {
    throw nb::value_error("use: expected one flag a sample");
  }
  return {count,
          time.data(),
          {force.data(), data(position), data(angle), data(velocity)},
          data(external),
          use ? use->data() : nullptr,
          source};
}

// path, role, parameters, start, lower, upper, scale
template <typename Finger>
nb::tuple unknown_of(const Finger& finger, std::size_t index) {
  const unknown_item& u = finger.unknowns().at(index);
  return nb::make_tuple(u.path, static_cast<int>(u.role), u.parameters, u.start, u.lower, u.upper, u.scale);
}

// A Python callable that may stop a long call, also by Ctrl-C or by what it raises.
class python_watch {
 public:
  explicit python_watch(const nb::object& watch) : watch_(watch.is_none() ? nullptr : &watch) {}

  // Without the GIL; `arguments` are made with it. Returns false to stop.
  template <typename Arguments>
  bool ask(const Arguments& arguments) {
    const nb::gil_scoped_acquire gil;
    try {
      if (PyErr_CheckSignals() != 0) { /* Ctrl-C */
        throw nb::python_error();
      }
      return !watch_ || !nb::object((*watch_)(*arguments())).is(nb::bool_(false));
    } catch (nb::python_error& error) {
      raised_ = std::make_unique<nb::python_error>(std::move(error));
      return false;
    }
  }

  // Afterwards, with the GIL: what it raised.
  void rethrow() {
    if (raised_) {
      raised_->restore();
      throw nb::python_error();
    }
  }

 private:
  const nb::object* watch_;
  std::unique_ptr<nb::python_error> raised_;
};

// watch(pass, stride, samples_done, samples, cost, best) -> bool
nb::dict fit(const estimator& all, const number_row& start, double prior_std, double tolerance, std::size_t passes,
             std::size_t stride, unsigned threads, const nb::object& watch) {
  const std::size_t u = all.unknowns().size();
  python_watch watching(watch);
  fit_result result;
  {
    const nb::gil_scoped_release without_gil;
    result = all.fit(copied(start), {prior_std, tolerance, passes, stride, threads}, [&](const fit_progress& p) {
      return watching.ask(
          [&] { return nb::make_tuple(p.pass, p.stride, p.samples_done, p.samples, p.cost, as_array(*p.best, {u})); });
    });
  }
  watching.rethrow();
  for (numbers* matrix : {&result.information, &result.covariance}) {
    matrix->resize(u * u);
  }
  result.gradient.resize(u);
  nb::dict fitted;
  fitted["z"] = as_array(std::move(result.z), {u});
  fitted["gradient"] = as_array(std::move(result.gradient), {u});
  fitted["information"] = as_array(std::move(result.information), {u, u});
  fitted["covariance"] = as_array(std::move(result.covariance), {u, u});
  fitted["cost"] = result.cost;
  fitted["prior_cost"] = result.prior_cost;
  fitted["passes"] = result.passes;
  fitted["steps"] = result.steps;
  fitted["converged"] = result.converged;
  fitted["stopped"] = result.stopped;
  return fitted;
}

void bind_estimator(nb::module_& m) {
  nb::class_<estimator>(m, "Estimator")
      .def(
          "__init__",
          [](estimator* all, const nb::bytes& image, const std::optional<group_row>& group,
             const std::optional<number_row>& scale) {
            new (all) estimator(image.data(), image.size(), copied(group), copied(scale));
          },
          nb::arg("image"), nb::arg("group") = nb::none(), nb::arg("scale") = nb::none())
      .def_prop_ro("joints", &estimator::joint_count)
      .def_prop_ro("tendons", &estimator::tendon_count)
      .def_prop_ro("parameter_count", &estimator::parameter_count)
      .def_prop_ro("unknown_count", [](const estimator& all) { return all.unknowns().size(); })
      .def("unknown", &unknown_of<estimator>)
      .def("values", [](const estimator& all, const number_row& z) { return as_array(all.values(copied(z))); })
      .def("unknown_values",
           [](const estimator& all, const number_row& values) { return as_array(all.unknown_values(copied(values))); })
      .def(
          "add_recording",
          [](estimator& all, const number_row& time, const number_rows& force,
             const std::optional<number_rows>& position, const std::optional<number_rows>& angle,
             const std::optional<number_rows>& velocity, int source, const std::optional<number_rows>& external,
             const std::optional<flag_row>& use, const std::optional<flag_rows>& silent) {
            recording_arrays added = recording_of(all, time, force, position, angle, velocity, source, external, use);
            if (silent && (silent->shape(0) != added.samples || silent->shape(1) != all.joint_count())) {
              throw nb::value_error("silent: expected one flag a sample and joint");
            }
            added.silent = silent ? silent->data() : nullptr;
            return all.add_recording(added);
          },
          nb::arg("time"), nb::arg("tendon_force"), nb::arg("tendon_position") = nb::none(),
          nb::arg("joint_position") = nb::none(), nb::arg("joint_velocity") = nb::none(),
          nb::arg("kinematics_source") = 1, nb::arg("external_torque") = nb::none(), nb::arg("use") = nb::none(),
          nb::arg("silent") = nb::none())
      .def(
          "set_weights",
          [](estimator& all, std::size_t recording, const number_row& weight) {
            all.set_weights(recording, copied(weight));
          },
          nb::arg("recording"), nb::arg("weight"))
      .def(
          "set_known",
          [](estimator& all, const number_rows& information) {
            all.set_known({information.data(), information.data() + information.size()});
          },
          nb::arg("information"))
      .def(
          "evaluate",
          [](const estimator& all, const number_row& z, std::size_t stride, unsigned threads) {
            const std::size_t u = all.unknowns().size();
            estimator::evaluation at;
            {
              const nb::gil_scoped_release without_gil;
              at = all.evaluate(copied(z), stride, threads);
            }
            return nb::make_tuple(at.cost, as_array(std::move(at.gradient)),
                                  as_array(std::move(at.information), {u, u}));
          },
          nb::arg("z"), nb::arg("stride") = 1, nb::arg("threads") = 0)
      .def("jacobian",
           [](const estimator& all, std::size_t recording, const number_row& z, std::size_t first, std::size_t count,
              std::size_t length) {
             const std::size_t u = all.unknowns().size(), n = all.joint_count();
             estimator::block_means means = all.jacobian(recording, copied(z), first, count, length);
             return nb::make_tuple(as_array(std::move(means.torque), {count, n}),
                                   as_array(std::move(means.jump), {count, n}),
                                   as_array(std::move(means.torque_derivative), {count, n, u}),
                                   as_array(std::move(means.jump_derivative), {count, n, u}));
           })
      .def("innovations",
           [](const estimator& all, std::size_t recording, const number_row& z) {
             estimator::residuals r = all.innovations(recording, copied(z));
             const std::size_t n = all.joint_count(), samples = r.variance.size() / n;
             return nb::make_tuple(as_array(std::move(r.innovation), {samples, n}),
                                   as_array(std::move(r.variance), {samples, n}),
                                   as_array(std::move(r.bias), {samples, n}));
           })
      .def("fit", &fit, nb::arg("start"), nb::arg("prior_std"), nb::arg("tolerance"), nb::arg("passes"),
           nb::arg("stride"), nb::arg("threads"), nb::arg("watch") = nb::none());
}

// innovation and variance [N, n], samples taken; watch(samples_done, samples) -> bool
nb::tuple run(learner& self, const number_row& time, const number_rows& force,
              const std::optional<number_rows>& position, const std::optional<number_rows>& angle,
              const std::optional<number_rows>& velocity, int source, const std::optional<number_rows>& external,
              const std::optional<flag_row>& use, const nb::object& watch) {
  const recording_arrays recording = recording_of(self, time, force, position, angle, velocity, source, external, use);
  const std::size_t n = self.joint_count();
  numbers innovation(recording.samples * n), variance(innovation);
  std::size_t done = 0;
  python_watch watching(watch);
  {
    const nb::gil_scoped_release without_gil;
    done = self.run(recording, innovation.data(), variance.data(), [&](std::size_t row, std::size_t samples) {
      return watching.ask([&] { return nb::make_tuple(row, samples); });
    });
  }
  watching.rethrow();
  return nb::make_tuple(as_array(std::move(innovation), {recording.samples, n}),
                        as_array(std::move(variance), {recording.samples, n}), done);
}

// What a call writes into two arrays, both [count], or [count] and [count, count].
template <typename Get>
nb::tuple two_arrays(std::size_t count, bool square, const Get& get) {
  numbers first(count), second(square ? count * count : count);
  get(first.data(), second.data());
  return nb::make_tuple(as_array(std::move(first)),
                        square ? as_array(std::move(second), {count, count}) : as_array(std::move(second)));
}

void bind_learner(nb::module_& m) {
  nb::class_<learner>(m, "Learner")
      .def(nb::new_([](const nb::bytes& image, const std::optional<group_row>& group,
                       const std::optional<number_row>& scale, double prior_std, std::size_t block,
                       double parameter_drift) {
             return make_learner(image.data(), image.size(), {prior_std, block, parameter_drift}, copied(group),
                                 copied(scale));
           }),
           nb::arg("image"), nb::arg("group") = nb::none(), nb::arg("scale") = nb::none(), nb::arg("prior_std") = 1.0,
           nb::arg("block") = 8, nb::arg("parameter_drift") = 0.0)
      .def_prop_ro("joints", &learner::joint_count)
      .def_prop_ro("tendons", &learner::tendon_count)
      .def_prop_ro("unknown_count", [](const learner& self) { return self.unknowns().size(); })
      .def_prop_ro("slack_samples", &learner::slack_samples)
      .def("unknown", &unknown_of<learner>)
      .def("run", &run, nb::arg("time"), nb::arg("tendon_force"), nb::arg("tendon_position") = nb::none(),
           nb::arg("joint_position") = nb::none(), nb::arg("joint_velocity") = nb::none(),
           nb::arg("kinematics_source") = 1, nb::arg("external_torque") = nb::none(), nb::arg("use") = nb::none(),
           nb::arg("watch") = nb::none())
      .def("begin_pass", &learner::begin_pass)
      .def("values",
           [](const learner& self) {
             return two_arrays(self.parameter_count(), false,
                               [&](double* values, double* errors) { self.get_values(values, errors); });
           })
      .def("unknown_values",
           [](const learner& self) {
             return two_arrays(self.unknowns().size(), true,
                               [&](double* z, double* covariance) { self.get_unknowns(z, covariance); });
           })
      .def("bias", [](const learner& self) {
        return two_arrays(self.joint_count(), false,
                          [&](double* bias, double* errors) { self.get_bias(bias, errors); });
      });
}

}  // namespace

NB_MODULE(_estimation, m) {
  bind_estimator(m);
  bind_learner(m);
}
