#include "information.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

#include "joint_sum.h"
#include "refusal.h"
#include "sample_rows.h"

namespace tendonfmu::estimation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/* Column 0 is the residual, y − T and what the bias holds of it; unknown k is column k + 1. */
constexpr std::size_t residual_column = 0;

/* What a segment of a recording adds up to, as if the bias held nothing at its start; see join(). */
struct SegmentSum {
  MatrixXd information; /* [q × q] lower triangle */
  std::vector<JointSegment> joints;
};

/* One thread's finger and buffers. */
class Worker {
 public:
  Worker(const Problem& problem, const std::vector<double>& numbers)
      : finger_(problem.image.data(), problem.image.size()),
        rows_(problem.unknowns, finger_.get()),
        unknowns_(problem.unknowns),
        numbers_(numbers) {
    for (std::size_t j = 0; j < problem.joints(); ++j) {
      std::size_t columns = 1;
      while (columns <= unknowns_.count() && unknowns_[columns - 1].joint <= j) {
        ++columns;
      }
      joints_.emplace_back(columns, 2 * unknowns_.rates().size());
    }
  }

  SegmentSum sum(const Recording& recording, const BiasGains& gains, std::size_t segment,
                 std::atomic<std::size_t>* done, const std::atomic<bool>& stopped) {
    const std::size_t first = segment * recording.segment_length();
    const std::size_t last = std::min(first + recording.segment_length(), recording.samples());
    const auto q = static_cast<Eigen::Index>(unknowns_.count() + 1);
    SegmentSum result;
    result.information = MatrixXd::Zero(q, q);
    for (JointSum& joint : joints_) {
      joint.begin_segment();
    }
    finger_.resume(recording.state(segment), numbers_);
    for (std::size_t k = first; k < last && !stopped; ++k) {
      finger_.step(k, recording.time(k), recording.inputs(k));
      take(recording, gains, k);
      if ((k + 1 - first) % block_length == 0 || k + 1 == last) {
        for (JointSum& joint : joints_) {
          joint.end_block(&result.information);
        }
        *done += (k - first) % block_length + 1;
      }
    }
    for (JointSum& joint : joints_) {
      result.joints.push_back(joint.end_segment(&result.information));
    }
    return result;
  }

 private:
  void take(const Recording& recording, const BiasGains& gains, std::size_t k) {
    const bool looked_at = gains.gain[k] > 0.0 || gains.weight[k] > 0.0;
    if (!looked_at && !jumps()) {
      return;
    }
    rows_.read();
    if (rows_.has_jump()) {
      for (std::size_t j = 0; j < joints_.size(); ++j) {
        joints_[j].first.jump(residual_column, rows_.jump(j));
      }
    }
    for (const Term& term : rows_.terms()) {
      add_term(term, looked_at);
    }
    if (!looked_at) {
      return;
    }
    for (const PlainTerm& term : rows_.plain_terms()) {
      joints_[term.joint].first.add(static_cast<std::size_t>(term.column) + 1, term.slope);
    }
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const double torque = rows_.measured(j) - recording.external_torque(k, j);
      joints_[j].first.add(residual_column, torque - rows_.torque(j));
      joints_[j].filter(gains.gain[k], gains.weight[k]);
    }
  }

  bool jumps() const {
    const tendonfmu_finger* f = finger_.get();
    for (std::size_t slot = 0; slot < f->slots; ++slot) {
      if (f->remembered.event[slot] != 0.0) {
        return true;
      }
    }
    return false;
  }

  void add_term(const Term& term, bool looked_at) {
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if (looked_at && term.torque && term.torque[j] != 0.0) {
        add_row(term, term.torque[j], &joints_[j]);
      }
      if (term.jump && term.jump[j] != 0.0) {
        add_jump(term, term.jump[j], &joints_[j]);
      }
    }
  }

  /* second derivatives of a law stand in columns 2·index, by rate and rate, and 2·index + 1, by rate and drop; that the
   * forces carry them along as well is left out: they only guide the steps */
  static void add_row(const Term& term, double factor, JointSum* joint) {
    if (term.run_length > 0) {
      joint->first.add_run(term.run_first + 1, term.run_length, term.run_slope.data(), factor);
    } else {
      for (std::size_t k = 0; k < 4; ++k) {
        if (term.column[k] >= 0) {
          joint->first.add(static_cast<std::size_t>(term.column[k]) + 1, factor * term.slope[k]);
        }
      }
    }
    if (term.side->index >= 0) {
      const double second[2] = {-term.speed * term.slope[2], -term.speed * term.slope[1]};
      joint->second.add_run(2 * static_cast<std::size_t>(term.side->index), 2, second, factor);
    }
  }

  static void add_jump(const Term& term, double factor, JointSum* joint) {
    if (term.run_length > 0) {
      joint->first.jump_run(term.run_first + 1, term.run_length, term.run_slope.data(), -factor);
    } else {
      for (std::size_t k = 0; k < 4; ++k) {
        if (term.column[k] >= 0) {
          joint->first.jump(static_cast<std::size_t>(term.column[k]) + 1, -factor * term.slope[k]);
        }
      }
    }
    if (term.side->index >= 0) {
      const double second[2] = {-term.speed * term.slope[2], -term.speed * term.slope[1]};
      joint->second.jump_run(2 * static_cast<std::size_t>(term.side->index), 2, second, -factor);
    }
  }

  FreeFinger finger_;
  SampleRows rows_;
  const Unknowns& unknowns_;
  const std::vector<double>& numbers_;
  std::vector<JointSum> joints_;
};

/* --- joining the segments of one recording, in order ---------------------------------------------------------------
 */

/* What the bias holds of each column, one joint. */
struct Held {
  VectorXd first, second;
};

/* at the start of a recording: nothing, or bias.initial_torque and its derivative */
std::vector<Held> held_at_start(const Problem& problem, const std::vector<double>& z, const SegmentSum& segment) {
  const derived_numbers& derived = problem.finger.get()->derived;
  std::vector<Held> held;
  for (std::size_t j = 0; j < problem.joints(); ++j) {
    held.push_back({VectorXd::Zero(segment.joints[j].held.size()), VectorXd::Zero(segment.joints[j].second.size())});
    if (derived.settings.has_initial_torque) {
      const std::int32_t column = problem.unknowns.initial_torque(j);
      held[j].first[residual_column] = column < 0 ? derived.initial_torque[j] : z[static_cast<std::size_t>(column)];
      if (column >= 0) {
        held[j].first[column + 1] = -1.0;
      }
    }
  }
  return held;
}

/* adds a segment to the sums, at whose start the bias holds `held`; leaves there what it holds at its end */
void join(const SegmentSum& segment, std::vector<Held>* held, MatrixXd* sum, VectorXd* second) {
  *sum += segment.information;
  for (std::size_t j = 0; j < held->size(); ++j) {
    const JointSegment& part = segment.joints[j];
    VectorXd &s = (*held)[j].first, &s2 = (*held)[j].second;
    *second += part.second + s2 * (part.squares * s[residual_column] - part.cross[residual_column]) -
               part.second_cross * s[residual_column];
    auto block = sum->topLeftCorner(s.size(), s.size());
    block.selfadjointView<Eigen::Lower>().rankUpdate(s, part.cross, -1.0);
    block.selfadjointView<Eigen::Lower>().rankUpdate(s, part.squares);
    s = part.kept * s + part.held;
    s2 = part.kept * s2 + part.second_held;
  }
}

/* --- threads --------------------------------------------------------------------------------------------------------
 */

struct Task {
  std::size_t recording, segment;
};

class Pass {
 public:
  Pass(const Problem& problem, const std::vector<double>& z, const PassOptions& options)
      : problem_(problem), z_(z), numbers_(problem.unknowns.write(z.data())) {
    for (std::size_t r = 0; r < problem.recordings.size(); ++r) {
      gains_.emplace_back(problem.recordings[r], problem.finger.get()->derived.settings, options.stride);
      for (std::size_t s = 0; s < problem.recordings[r].segments(); ++s) {
        tasks_.push_back({r, s});
      }
    }
    waiting_.resize(tasks_.size());
    const auto q = static_cast<Eigen::Index>(problem.unknowns.count() + 1);
    sum_ = MatrixXd::Zero(q, q);
    second_ = VectorXd::Zero(static_cast<Eigen::Index>(2 * problem.unknowns.rates().size()));
    const unsigned cores = options.threads ? options.threads : std::max(1u, std::thread::hardware_concurrency());
    threads_ = std::min<std::size_t>(cores, tasks_.size());
  }

  /* false: stopped */
  bool run(const Watch& watch) {
    std::vector<std::thread> threads;
    for (std::size_t k = 0; k < threads_; ++k) {
      threads.emplace_back([this] { work(); });
    }
    std::unique_lock<std::mutex> lock(mutex_);
    while (!finished_.wait_for(lock, std::chrono::milliseconds(50), [this] { return ended_ == threads_; })) {
      lock.unlock();
      if (watch && !watch(done_)) {
        stopped_ = true;
      }
      lock.lock();
    }
    lock.unlock();
    for (std::thread& thread : threads) {
      thread.join();
    }
    if (failure_) {
      std::rethrow_exception(failure_);
    }
    return !stopped_;
  }

  const MatrixXd& sum() const { return sum_; } /* [q × q] lower triangle */
  const VectorXd& second() const { return second_; }

 private:
  void work() {
    try {
      Worker worker(problem_, numbers_);
      for (std::size_t k = next_++; k < tasks_.size() && !stopped_; k = next_++) {
        const Task& task = tasks_[k];
        auto segment = std::make_unique<SegmentSum>(
            worker.sum(problem_.recordings[task.recording], gains_[task.recording], task.segment, &done_, stopped_));
        const std::lock_guard<std::mutex> lock(mutex_);
        waiting_[k] = std::move(segment);
        join_waiting();
      }
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex_);
      failure_ = std::current_exception();
      stopped_ = true;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    ++ended_;
    finished_.notify_one();
  }

  /* in the order of the recordings, so that the sum is the same with any number of threads */
  void join_waiting() {
    for (; joined_ < tasks_.size() && waiting_[joined_]; ++joined_) {
      if (tasks_[joined_].segment == 0) {
        held_ = held_at_start(problem_, z_, *waiting_[joined_]);
      }
      join(*waiting_[joined_], &held_, &sum_, &second_);
      waiting_[joined_].reset();
    }
  }

  const Problem& problem_;
  const std::vector<double>& z_;
  const std::vector<double> numbers_;
  std::vector<BiasGains> gains_;
  std::vector<Task> tasks_;
  std::vector<std::unique_ptr<SegmentSum>> waiting_;
  std::vector<Held> held_;
  MatrixXd sum_;
  VectorXd second_;
  std::size_t threads_ = 1, joined_ = 0, ended_ = 0;
  std::atomic<std::size_t> next_{0}, done_{0};
  std::atomic<bool> stopped_{false};
  std::mutex mutex_;
  std::condition_variable finished_;
  std::exception_ptr failure_;
};

}  // namespace

Problem::Problem(const void* data, std::size_t size, const std::int32_t* group, const double* scale)
    : image(static_cast<const unsigned char*>(data), static_cast<const unsigned char*>(data) + size),
      finger(data, size),
      unknowns(finger.get(), group, scale) {}

std::size_t Problem::samples() const {
  std::size_t sum = 0;
  for (const Recording& recording : recordings) {
    sum += recording.samples();
  }
  return sum;
}

Evaluation evaluate(const Problem& problem, const std::vector<double>& z, const PassOptions& options,
                    const Watch& watch) {
  if (problem.recordings.empty()) {
    throw refused("no recording: expected at least one");
  }
  const auto p = static_cast<Eigen::Index>(problem.unknowns.count());
  Pass pass(problem, z, options);
  Evaluation result;
  if (!pass.run(watch)) {
    return result;
  }
  const MatrixXd sum = pass.sum().selfadjointView<Eigen::Lower>();
  result.cost = 0.5 * sum(0, 0);
  result.gradient = -sum.col(0).tail(p);
  result.information = sum.bottomRightCorner(p, p);
  result.second = -pass.second();
  result.complete = true;
  return result;
}

}  // namespace tendonfmu::estimation
