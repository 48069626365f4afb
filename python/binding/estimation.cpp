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

// A recording of an estimator or a learner, in arrays that it keeps.
struct bound_recording : recording_arrays {
  template <typename Finger>
  bound_recording(const Finger& finger, const nb::object& arrays, int source,
                  const std::optional<number_rows>& external, const std::optional<flag_row>& use) {
    time_ = array_in<number_row>(arrays, "time");
    if (!time_) {
      throw refusal("time: missing");
    }
    samples = time_->shape(0);
    time = time_->data();
    const std::size_t n = finger.joint_count(), m = finger.tendon_count();
    inputs = {signal(arrays, "tendon_force", m), signal(arrays, "tendon_position", m),
              signal(arrays, "joint_position", n), signal(arrays, "joint_velocity", n)};
    external_torque = rows(external, "external_torque", n);
    if (use && use->shape(0) != samples) {
      throw refusal("use: expected one flag a sample");
    }
    this->use = use ? use->data() : nullptr;
    kinematics_source = source;
  }

 private:
  std::optional<number_row> time_;
  std::vector<std::optional<number_rows>> kept_;

  const double* signal(const nb::object& arrays, const char* name, std::size_t columns) {
    kept_.push_back(array_in<number_rows>(arrays, name));
    return rows(kept_.back(), name, columns);
  }
  const double* rows(const std::optional<number_rows>& array, const char* name, std::size_t columns) const {
    if (array && (array->shape(0) != samples || array->shape(1) != columns)) {
      throw refusal(std::string(name) + ": expected " + std::to_string(samples) + " rows of " +
                    std::to_string(columns) + " columns");
    }
    return array ? array->data() : nullptr;
  }
};

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

// progress(pass, stride, samples_done, samples, cost, best) -> bool
fit_result fit(const estimator& all, const std::optional<number_row>& start, double prior_std, std::size_t passes,
               double tolerance, unsigned threads, std::size_t stride, const nb::object& progress) {
  const std::size_t u = all.unknowns().size();
  python_watch watching(progress);
  fit_result result;
  {
    const nb::gil_scoped_release without_gil;
    result =
        all.fit(start ? copied(*start) : all.start(), {prior_std, tolerance, passes, stride, threads},
                [&](const fit_progress& p) {
                  return watching.ask([&] {
                    return nb::make_tuple(p.pass, p.stride, p.samples_done, p.samples, p.cost, as_array(*p.best, {u}));
                  });
                });
  }
  watching.rethrow();
  for (numbers* matrix : {&result.information, &result.covariance}) {
    matrix->resize(u * u);
  }
  result.gradient.resize(u);
  return result;
}

// A matrix [u, u] of a result.
template <numbers fit_result::*matrix>
nb::object square(const fit_result& found) {
  return as_array(found.*matrix, {found.gradient.size(), found.gradient.size()});
}

void bind_results(nb::module_& m) {
  static constexpr const char* roles[] = {"coulomb", "drop", "rate", "viscous", "value"};
  nb::class_<unknown_item>(m, "Unknown")
      .def_ro("path", &unknown_item::path)
      .def_prop_ro("role", [](const unknown_item& u) { return roles[static_cast<int>(u.role)]; })
      .def_prop_ro("parameters", [](const unknown_item& u) { return nb::tuple(nb::cast(u.parameters)); })
      .def_ro("start", &unknown_item::start)
      .def_ro("lower", &unknown_item::lower)
      .def_ro("upper", &unknown_item::upper)
      .def_ro("scale", &unknown_item::scale)
      .def_prop_ro("name", [](const unknown_item& u) {
        const std::string place = u.path.substr(0, u.path.rfind('.') + 1);
        return u.role == unknown_role::value ? u.path : place + roles[static_cast<int>(u.role)];
      });
  nb::class_<fit_result>(m, "BatchResult")
      .def_prop_ro("z", [](const fit_result& found) { return as_array(found.z); })
      .def_prop_ro("gradient", [](const fit_result& found) { return as_array(found.gradient); })
      .def_prop_ro("information", &square<&fit_result::information>)
      .def_prop_ro("covariance", &square<&fit_result::covariance>)
      .def_ro("cost", &fit_result::cost)
      .def_ro("prior_cost", &fit_result::prior_cost)
      .def_ro("passes", &fit_result::passes)
      .def_ro("steps", &fit_result::steps)
      .def_ro("converged", &fit_result::converged)
      .def_ro("stopped", &fit_result::stopped);
}

// Of the unknowns of an estimator or a learner: their start, or another number of each.
template <double unknown_item::*number, typename Finger>
nb::object of_unknowns(const Finger& finger) {
  numbers values;
  for (const unknown_item& unknown : finger.unknowns()) {
    values.push_back(unknown.*number);
  }
  return as_array(std::move(values));
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
      .def_prop_ro("unknowns", &estimator::unknowns)
      .def_prop_ro("start", &of_unknowns<&unknown_item::start, estimator>)
      .def_prop_ro("scale", &of_unknowns<&unknown_item::scale, estimator>)
      .def("values", [](const estimator& all, const number_row& z) { return as_array(all.values(copied(z))); })
      .def("unknown_values",
           [](const estimator& all, const number_row& values) { return as_array(all.unknown_values(copied(values))); })
      .def(
          "add_recording",
          [](estimator& all, const nb::object& arrays, int source, const std::optional<number_rows>& external,
             const std::optional<flag_row>& use, const std::optional<flag_rows>& silent) {
            bound_recording added(all, arrays, source, external, use);
            if (silent && (silent->shape(0) != added.samples || silent->shape(1) != all.joint_count())) {
              throw refusal("silent: expected one flag a sample and joint");
            }
            added.silent = silent ? silent->data() : nullptr;
            return all.add_recording(added);
          },
          nb::arg("arrays"), nb::arg("kinematics_source") = 1, nb::arg("external_torque") = nb::none(),
          nb::arg("use") = nb::none(), nb::arg("silent") = nb::none())
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
      .def(
          "jacobian",
          [](const estimator& all, std::size_t recording, const number_row& z, std::size_t start, std::size_t stop,
             std::size_t length) {
            const std::size_t u = all.unknowns().size(), n = all.joint_count();
            const std::size_t count = stop > start ? (stop - start) / length : 0;
            estimator::block_means means = all.jacobian(recording, copied(z), start, count, length);
            return nb::make_tuple(as_array(std::move(means.torque), {count, n}),
                                  as_array(std::move(means.jump), {count, n}),
                                  as_array(std::move(means.torque_derivative), {count, n, u}),
                                  as_array(std::move(means.jump_derivative), {count, n, u}));
          },
          nb::arg("recording"), nb::arg("z"), nb::arg("start"), nb::arg("stop"), nb::arg("length") = 1)
      .def("innovations",
           [](const estimator& all, std::size_t recording, const number_row& z) {
             estimator::residuals r = all.innovations(recording, copied(z));
             const std::size_t n = all.joint_count(), samples = r.variance.size() / n;
             return nb::make_tuple(as_array(std::move(r.innovation), {samples, n}),
                                   as_array(std::move(r.variance), {samples, n}),
                                   as_array(std::move(r.bias), {samples, n}));
           })
      .def("fit", &fit, nb::arg("start") = nb::none(), nb::arg("prior_std") = 1.0, nb::arg("max_passes") = 60,
           nb::arg("tolerance") = 0.3, nb::arg("threads") = 0, nb::arg("stride") = 0, nb::arg("progress") = nb::none());
}

// progress(samples_done, samples) -> bool
nb::dict run(learner& self, const nb::object& arrays, int source, const std::optional<number_rows>& external,
             const std::optional<flag_row>& use, const nb::object& progress) {
  const bound_recording recording(self, arrays, source, external, use);
  const std::size_t n = self.joint_count();
  numbers innovation(recording.samples * n), variance(innovation);
  python_watch watching(progress);
  {
    const nb::gil_scoped_release without_gil;
    self.run(recording, innovation.data(), variance.data(), [&](std::size_t row, std::size_t samples) {
      return watching.ask([&] { return nb::make_tuple(row, samples); });
    });
  }
  watching.rethrow();
  nb::dict outputs;
  outputs["innovation"] = as_array(std::move(innovation), {recording.samples, n});
  outputs["innovation_variance"] = as_array(std::move(variance), {recording.samples, n});
  return outputs;
}

// What a getter of two arrays writes into the first, or the second.
template <void (learner::*get)(double*, double*) const, bool second = false>
nb::object got(const learner& self, std::size_t count) {
  numbers values(count);
  (self.*get)(second ? nullptr : values.data(), second ? values.data() : nullptr);
  return as_array(std::move(values));
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
      .def_prop_ro("unknowns", &learner::unknowns)
      .def_prop_ro("slack_samples", &learner::slack_samples)
      .def("run", &run, nb::arg("arrays"), nb::arg("kinematics_source") = 1, nb::arg("external_torque") = nb::none(),
           nb::arg("use") = nb::none(), nb::arg("progress") = nb::none())
      .def("begin_pass", &learner::begin_pass)
      .def("values", [](const learner& self) { return got<&learner::get_values>(self, self.parameter_count()); })
      .def("standard_errors",
           [](const learner& self) { return got<&learner::get_values, true>(self, self.parameter_count()); })
      .def_prop_ro("z", [](const learner& self) { return got<&learner::get_unknowns>(self, self.unknowns().size()); })
      .def_prop_ro("covariance",
                   [](const learner& self) {
                     const std::size_t u = self.unknowns().size();
                     numbers covariance(u * u);
                     self.get_unknowns(nullptr, covariance.data());
                     return as_array(std::move(covariance), {u, u});
                   })
      .def_prop_ro("bias", [](const learner& self) { return got<&learner::get_bias>(self, self.joint_count()); });
}

}  // namespace

NB_MODULE(_estimation, m) {
  nb::exception<std::invalid_argument>(m, "EstimationError", PyExc_ValueError);
  bind_results(m);
  bind_estimator(m);
  bind_learner(m);
}
