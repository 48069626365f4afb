#include "information.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <mutex>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "joint_sum.h"
#include "sample_rows.h"

namespace tendonfmu::estimation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/* Column 0 is the residual: y − T, and what the bias holds of it. */
constexpr std::size_t residual_column = 0;
constexpr std::size_t told_every = 256; /* samples, of what is done */

/* What a segment of a recording adds up to, as if the bias held nothing at its start; see join(). */
struct segment_sum {
  MatrixXd information; /* [q × q] lower triangle */
  std::vector<joint_segment> joints;
};

/* One thread's finger and buffers. */
class pass_worker {
 public:
  pass_worker(const fit_problem& problem, const std::vector<double>& numbers, bool expanded)
      : finger_(problem.image.data(), problem.image.size()),
        rows_(problem.unknowns, finger_.get()),
        columns_(problem.columns),
        numbers_(numbers),
        expanded_(expanded) {
    for (const std::size_t columns : columns_.end) {
      joints_.emplace_back(columns);
    }
  }

  segment_sum sum(const recording_track& recording, const bias_gains& gains, std::size_t segment,
                  std::atomic<std::size_t>* done, const std::atomic<bool>& stopped) {
    const std::size_t first = segment * recording.segment_length();
    const std::size_t last = std::min(first + recording.segment_length(), recording.samples());
    const auto q = static_cast<Eigen::Index>(columns_.count);
    segment_sum result;
    result.information = MatrixXd::Zero(q, q);
    for (joint_sum& joint : joints_) {
      joint.begin_segment();
    }
    finger_.resume(recording.states()[segment], numbers_);
    for (std::size_t k = first; k < last && !stopped; ++k) {
      finger_.step(k, recording.time(k), recording.inputs(k));
      take(recording, gains, k);
      if (k + 1 == last || std::any_of(joints_.begin(), joints_.end(), [](const joint_sum& j) { return j.full(); })) {
        for (joint_sum& joint : joints_) {
          joint.end_block(&result.information);
        }
      }
      if ((k + 1 - first) % told_every == 0 || k + 1 == last) {
        *done += (k - first) % told_every + 1;
      }
    }
    for (joint_sum& joint : joints_) {
      result.joints.push_back(joint.end_segment(&result.information));
    }
    return result;
  }

 private:
  void take(const recording_track& recording, const bias_gains& gains, std::size_t k) {
    const double *gain = &gains.gain[k * joints_.size()], *weight = &gains.weight[k * joints_.size()];
    bool looked_at = false;
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      looked_at = looked_at || gain[j] > 0.0 || weight[j] > 0.0;
    }
    if (!looked_at && !rows_.sees_event()) {
      return;
    }
    rows_.read();
    if (rows_.has_jump()) {
      for (std::size_t j = 0; j < joints_.size(); ++j) {
        joints_[j].rows.add(block_rows::bias, residual_column, rows_.jump(j));
      }
    }
    for (const sensitivity_term& term : rows_.terms()) {
      add_term(term, looked_at);
    }
    if (!looked_at) {
      return;
    }
    for (const plain_slope& term : rows_.plain_terms()) {
      joints_[term.joint].rows.add(block_rows::sample, columns_.unknown[static_cast<std::size_t>(term.column)],
                                   term.slope);
    }
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const double torque = rows_.measured(j) - recording.external_torque(k, j);
      joints_[j].rows.add(block_rows::sample, residual_column, torque - rows_.torque(j));
      joints_[j].filter(gain[j], weight[j] * recording.weight_root(j));
    }
  }

  void add_term(const sensitivity_term& term, bool looked_at) {
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if (looked_at && term.torque && term.torque[j] != 0.0) {
        add_slopes(term, term.torque[j], block_rows::sample, &joints_[j].rows);
      }
      if (term.jump && term.jump[j] != 0.0) {
        add_slopes(term, -term.jump[j], block_rows::bias, &joints_[j].rows);
      }
    }
  }

  void add_slopes(const sensitivity_term& term, double factor, block_rows::part to, block_rows* rows) const {
    const side_columns& side = *term.side;
    if (side.run_length > 0) {
      rows->add_run(to, columns_.unknown[side.run_first], side.run_length, term.run_slope.data(), factor);
    } else {
      for (std::size_t k = 0; k < 4; ++k) {
        if (side.column[k] >= 0) {
          rows->add(to, columns_.unknown[static_cast<std::size_t>(side.column[k])], factor * term.slope[k]);
        }
      }
    }
    if (expanded_ && side.index >= 0) {
      const std::array<double, 2> values = expansion(term);
      rows->add_run(to, columns_.expansion[static_cast<std::size_t>(side.index)], 2, values.data(), factor);
    }
  }

  /* v²E and −v³E with sign and weight; that the forces carry changes along to second order, too, is left out: this only
   * guides the steps */
  static std::array<double, 2> expansion(const sensitivity_term& term) {
    const double square = term.speed * term.speed * term.slope[1];
    return {square, -term.speed * square};
  }

  free_finger finger_;
  sample_rows rows_;
  const gram_columns& columns_;
  const std::vector<double>& numbers_;
  const bool expanded_;
  std::vector<joint_sum> joints_;
};

/* --- joining the segments of one recording, in order -------------------------------------------------------------- */

/* what the bias holds of each column at the start of a recording: nothing, or bias.initial_torque and its derivative */
std::vector<VectorXd> held_at_start(const fit_problem& problem, const std::vector<double>& z) {
  const derived_numbers& derived = problem.finger.get()->derived;
  std::vector<VectorXd> held;
  for (std::size_t j = 0; j < problem.joints(); ++j) {
    held.push_back(VectorXd::Zero(static_cast<Eigen::Index>(problem.columns.end[j])));
    if (derived.settings.has_initial_torque) {
      const std::int32_t unknown = problem.unknowns.initial_torque(j);
      const auto at = static_cast<std::size_t>(std::max(unknown, 0));
      held[j][residual_column] = unknown < 0 ? derived.initial_torque[j] : z[at];
      if (unknown >= 0) {
        held[j][static_cast<Eigen::Index>(problem.columns.unknown[at])] = -1.0;
      }
    }
  }
  return held;
}

/* adds a segment to the sum, at whose start the bias holds `held`; leaves there what it holds at its end */
void join(const segment_sum& segment, std::vector<VectorXd>* held, MatrixXd* sum) {
  *sum += segment.information;
  for (std::size_t j = 0; j < held->size(); ++j) {
    const joint_segment& part = segment.joints[j];
    VectorXd& s = (*held)[j];
    auto block = sum->topLeftCorner(s.size(), s.size());
    block.selfadjointView<Eigen::Lower>().rankUpdate(s, part.cross, -1.0);
    block.selfadjointView<Eigen::Lower>().rankUpdate(s, part.squares);
    s = part.kept * s + part.held;
  }
}

/* --- threads ------------------------------------------------------------------------------------------------------ */

struct pass_task {
  std::size_t recording, segment;
};

class data_pass {
 public:
  data_pass(const fit_problem& problem, const std::vector<double>& z, const pass_options& options)
      : problem_(problem), z_(z), numbers_(problem.unknowns.write(z.data())), expanded_(options.expanded) {
    for (std::size_t r = 0; r < problem.recordings.size(); ++r) {
      gains_.emplace_back(problem.recordings[r], problem.finger.get()->derived.settings, options.stride);
      for (std::size_t s = 0; s < problem.recordings[r].segments(); ++s) {
        tasks_.push_back({r, s});
      }
    }
    waiting_.resize(tasks_.size());
    const auto q = static_cast<Eigen::Index>(problem.columns.count);
    sum_ = MatrixXd::Zero(q, q);
    const unsigned cores = options.threads ? options.threads : std::max(1u, std::thread::hardware_concurrency());
    threads_ = std::min<std::size_t>(cores, tasks_.size());
  }

  /* false: stopped */
  bool run(const pass_watch& watch) {
    if (watch && !watch(0)) { /* once at least, however short the pass */
      return false;
    }
    std::vector<std::future<void>> team; /* ended with it, after what ends it */
    const std::unique_ptr<std::atomic<bool>, void (*)(std::atomic<bool>*)> stop(&stopped_,
                                                                                [](auto* all) { *all = true; });
    try {
      for (std::size_t k = 0; k < threads_; ++k) {
        team.push_back(std::async(std::launch::async, &data_pass::work, this));
      }
    } catch (const std::system_error&) { /* the system gives no more threads: fewer do the same */
      if (team.empty()) {
        throw;
      }
    }
    for (std::future<void>& member : team) {
      while (member.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
        if (watch && !watch(done_)) {
          stopped_ = true;
        }
      }
      member.get();
    }
    return !stopped_;
  }

  const MatrixXd& sum() const { return sum_; } /* [q × q] lower triangle */

 private:
  void work() try {
    pass_worker worker(problem_, numbers_, expanded_);
    for (std::size_t k = next_++; k < tasks_.size() && !stopped_; k = next_++) {
      const pass_task& task = tasks_[k];
      auto segment = std::make_unique<segment_sum>(
          worker.sum(problem_.recordings[task.recording], gains_[task.recording], task.segment, &done_, stopped_));
      const std::lock_guard<std::mutex> lock(mutex_);
      waiting_[k] = std::move(segment);
      join_waiting();
    }
  } catch (...) {
    stopped_ = true;
    throw;
  }

  /* in the order of the recordings, so that the sum is the same with any number of threads */
  void join_waiting() {
    for (; joined_ < tasks_.size() && waiting_[joined_]; ++joined_) {
      if (tasks_[joined_].segment == 0) {
        held_ = held_at_start(problem_, z_);
      }
      join(*waiting_[joined_], &held_, &sum_);
      waiting_[joined_].reset();
    }
  }

  const fit_problem& problem_;
  const std::vector<double>& z_;
  const std::vector<double> numbers_;
  const bool expanded_;
  std::vector<bias_gains> gains_;
  std::vector<pass_task> tasks_;
  std::vector<std::unique_ptr<segment_sum>> waiting_;
  std::vector<VectorXd> held_;
  MatrixXd sum_;
  std::size_t threads_ = 1, joined_ = 0;
  std::atomic<std::size_t> next_{0}, done_{0};
  std::atomic<bool> stopped_{false};
  std::mutex mutex_;
};

}  // namespace

fit_problem::fit_problem(const void* data, std::size_t size, const std::vector<std::int32_t>& group,
                         const numbers& scale)
    : image(static_cast<const unsigned char*>(data), static_cast<const unsigned char*>(data) + size),
      finger(data, size),
      unknowns(finger.get(), group, scale),
      columns(unknowns, finger.get()->joints) {}

gram_columns::gram_columns(const unknown_list& unknowns, std::size_t joints) {
  unknown.resize(unknowns.count());
  expansion.resize(unknowns.rates().size());
  for (std::size_t j = 0; j < joints; ++j) {
    for (std::size_t k = 0; k < unknowns.count(); ++k) {
      if (unknowns[k].joint == j) {
        unknown[k] = count++;
      }
    }
    for (std::size_t k = 0; k < expansion.size(); ++k) {
      if (unknowns[static_cast<std::size_t>(unknowns.rates()[k][0])].joint == j) {
        expansion[k] = count;
        count += 2;
      }
    }
    end.push_back(count);
  }
}

std::size_t fit_problem::samples() const {
  std::size_t sum = 0;
  for (const recording_track& recording : recordings) {
    sum += recording.samples();
  }
  return sum;
}

cost_evaluation evaluate(const fit_problem& problem, const std::vector<double>& z, const pass_options& options,
                         const pass_watch& watch) {
  if (problem.recordings.empty()) {
    throw std::invalid_argument("no recording: expected at least one");
  }
  data_pass pass(problem, z, options);
  cost_evaluation result;
  if (!pass.run(watch)) {
    return result;
  }
  result.gram = pass.sum().selfadjointView<Eigen::Lower>();
  const std::vector<std::size_t>& at = problem.columns.unknown;
  result.cost = 0.5 * result.gram(0, 0);
  result.gradient = -result.gram(at, residual_column);
  result.information = result.gram(at, at);
  result.complete = true;
  return result;
}

}  // namespace tendonfmu::estimation
