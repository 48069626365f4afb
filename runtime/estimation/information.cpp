#include "information.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

#include "refusal.h"
#include "sample_rows.h"
#include "symmetric_update.h"

namespace tendonfmu::estimation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t block_length = 128; /* samples whose rows are summed at a time */
constexpr std::size_t dense_rows = 32;    /* rows of whole blocks summed at a time */

/* Column 0 is the residual, y − T and what the bias holds of it; unknown k is column k + 1. */
constexpr std::size_t residual_column = 0;

/* One joint's rows over a block, kept to the columns that appear in it. */
class JointBlock {
 public:
  explicit JointBlock(std::size_t columns)
      : columns_(columns),
        stride_((columns + 7) / 8 * 8 + 8), /* no power of two: rows do not fall onto each other in the cache */
        local_(columns, -1),
        rows_(block_length * stride_, 0.0),
        row_(stride_, 0.0),
        held_(stride_, 0.0),
        mean_(stride_, 0.0),
        product_(stride_ * stride_, 0.0) {
    active_.reserve(columns);
    activate(residual_column);
  }

  void add(std::size_t column, double value) { row_[activate(column)] += value; }
  /* the bias jumps: b increases with the jump, what it holds of a column decreases */
  void jump(std::size_t column, double change) { held_[activate(column)] += change; }

  /* ends the row of one sample, K and 1/√S as in BiasGains */
  void whiten(double gain, double weight) {
    const std::size_t count = active_.size();
    if (weight > 0.0) {
      double* row = rows_.data() + used_ * stride_;
      for (std::size_t c = 0; c < count; ++c) {
        row[c] = (row_[c] - held_[c]) * weight;
      }
      decay_[used_] = kept_ * weight;
      squares_ += decay_[used_] * decay_[used_];
      ++used_;
    }
    if (gain > 0.0) {
      for (std::size_t c = 0; c < count; ++c) {
        held_[c] += gain * (row_[c] - held_[c]);
      }
      kept_ *= 1.0 - gain;
    }
    std::fill_n(row_.begin(), count, 0.0);
  }

  void reject_row() { std::fill_n(row_.begin(), active_.size(), 0.0); }

  std::size_t used() const { return used_; }
  double kept() const { return kept_; }       /* Π (1 − K) */
  double squares() const { return squares_; } /* C */
  const std::vector<std::size_t>& active() const { return active_; }
  const std::vector<double>& held() const { return held_; }
  const std::vector<double>& mean() const { return mean_; } /* u / C, of the active columns */

  /* takes c_i·u/C off every row and adds their outer products to sum [q × q] */
  void sum_rows(MatrixXd* sum) {
    const std::size_t count = active_.size();
    std::fill_n(mean_.begin(), count, 0.0);
    if (squares_ > 0.0) {
      for (std::size_t i = 0; i < used_; ++i) {
        add_scaled(rows_.data() + i * stride_, decay_[i] / squares_, mean_.data(), count);
      }
      for (std::size_t i = 0; i < used_; ++i) {
        add_scaled(mean_.data(), -decay_[i], rows_.data() + i * stride_, count);
      }
    }
    std::fill_n(product_.begin(), count * count, 0.0);
    add_outer_products(product_.data(), count, rows_.data(), used_, stride_, 1.0);
    for (std::size_t c = 0; c < count; ++c) {
      for (std::size_t r = c; r < count; ++r) {
        const auto a = static_cast<Eigen::Index>(std::max(active_[r], active_[c]));
        const auto b = static_cast<Eigen::Index>(std::min(active_[r], active_[c]));
        (*sum)(a, b) += product_[c * count + r];
      }
    }
  }

  void clear() {
    for (std::size_t i = 0; i < used_; ++i) {
      std::fill_n(rows_.begin() + static_cast<std::ptrdiff_t>(i * stride_), active_.size(), 0.0);
    }
    std::fill_n(held_.begin(), active_.size(), 0.0);
    for (const std::size_t column : active_) {
      local_[column] = -1;
    }
    active_.clear();
    activate(residual_column);
    used_ = 0;
    kept_ = 1.0;
    squares_ = 0.0;
  }

 private:
  static void add_scaled(const double* from, double factor, double* to, std::size_t count) {
    for (std::size_t c = 0; c < count; ++c) {
      to[c] += factor * from[c];
    }
  }

  std::size_t activate(std::size_t column) {
    if (local_[column] < 0) {
      local_[column] = static_cast<std::int32_t>(active_.size());
      active_.push_back(column);
    }
    return static_cast<std::size_t>(local_[column]);
  }

  std::size_t columns_, stride_;
  std::vector<std::int32_t> local_; /* place of a column among the active ones, −1 */
  std::vector<std::size_t> active_;
  std::vector<double> rows_, row_, held_, mean_, product_;
  std::array<double, block_length> decay_{}; /* c_i */
  std::size_t used_ = 0;
  double kept_ = 1.0, squares_ = 0.0;
};

/* What a segment of a recording adds up to, as if the bias held nothing at its start; see join(). */
struct SegmentSum {
  MatrixXd information;             /* [q × q] lower triangle */
  std::vector<VectorXd> held;       /* per joint [q_j]: at the end */
  std::vector<VectorXd> cross;      /* per joint [q_j]: Σ c_i ν_i */
  double kept = 1.0, squares = 0.0; /* Π (1 − K), Σ c_i²: the same for all joints */
};

/* One joint over a segment: blocks, and the dense rows between them. */
class JointSum {
 public:
  explicit JointSum(std::size_t columns)
      : block(columns),
        held_(columns, 0.0),
        cross_(columns, 0.0),
        dense_(dense_rows * columns),
        sum_(columns * columns) {
    reset();
  }

  JointBlock block;

  void reset() {
    std::fill(held_.begin(), held_.end(), 0.0);
    std::fill(cross_.begin(), cross_.end(), 0.0);
    std::fill(sum_.begin(), sum_.end(), 0.0);
    kept_ = 1.0;
    squares_ = 0.0;
    used_ = 0;
    block.clear();
  }

  void end_block(MatrixXd* sum) {
    const std::size_t columns = held_.size();
    if (block.used() > 0) {
      block.sum_rows(sum);
      const double root = std::sqrt(block.squares());
      double* z = dense_.data() + used_ * columns;
      for (std::size_t c = 0; c < columns; ++c) {
        z[c] = root * held_[c];
        cross_[c] -= kept_ * block.squares() * held_[c];
      }
      for (std::size_t k = 0; k < block.active().size(); ++k) {
        const std::size_t c = block.active()[k];
        z[c] -= root * block.mean()[k];
        cross_[c] += kept_ * block.squares() * block.mean()[k];
      }
      squares_ += kept_ * kept_ * block.squares();
      if (++used_ == dense_rows) {
        flush();
      }
    }
    const double kept = block.kept();
    for (double& value : held_) {
      value *= kept;
    }
    for (std::size_t k = 0; k < block.active().size(); ++k) {
      held_[block.active()[k]] += block.held()[k];
    }
    kept_ *= kept;
    block.clear();
  }

  void end_segment(SegmentSum* to) {
    flush();
    const std::size_t columns = held_.size();
    for (std::size_t c = 0; c < columns; ++c) {
      for (std::size_t r = c; r < columns; ++r) {
        to->information(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) += sum_[c * columns + r];
      }
    }
    to->held.emplace_back(Eigen::Map<const VectorXd>(held_.data(), static_cast<Eigen::Index>(columns)));
    to->cross.emplace_back(Eigen::Map<const VectorXd>(cross_.data(), static_cast<Eigen::Index>(columns)));
    to->kept = kept_;
    to->squares = squares_;
  }

 private:
  void flush() {
    add_outer_products(sum_.data(), held_.size(), dense_.data(), used_, held_.size(), 1.0);
    used_ = 0;
  }

  std::vector<double> held_, cross_, dense_, sum_;
  double kept_ = 1.0, squares_ = 0.0;
  std::size_t used_ = 0;
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
      joints_.emplace_back(columns);
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
      joint.reset();
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
      joint.end_segment(&result);
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
        joints_[j].block.jump(residual_column, rows_.jump(j));
      }
    }
    for (const Term& term : rows_.terms()) {
      add_term(term, looked_at);
    }
    if (!looked_at) {
      return;
    }
    for (const PlainTerm& term : rows_.plain_terms()) {
      joints_[term.joint].block.add(static_cast<std::size_t>(term.column) + 1, term.slope);
    }
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const double torque = rows_.measured(j) - recording.external_torque(k, j);
      joints_[j].block.add(residual_column, torque - rows_.torque(j));
      joints_[j].block.whiten(gains.gain[k], gains.weight[k]);
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
    for (std::size_t k = 0; k < 4; ++k) {
      if (term.column[k] < 0 || term.slope[k] == 0.0) {
        continue;
      }
      const std::size_t column = static_cast<std::size_t>(term.column[k]) + 1;
      for (std::size_t j = 0; j < joints_.size(); ++j) {
        if (looked_at && term.torque && term.torque[j] != 0.0) {
          joints_[j].block.add(column, term.slope[k] * term.torque[j]);
        }
        if (term.jump && term.jump[j] != 0.0) {
          joints_[j].block.jump(column, -term.slope[k] * term.jump[j]);
        }
      }
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

/* what the bias holds at the start of a recording: nothing, or bias.initial_torque and its derivative */
std::vector<VectorXd> held_at_start(const Problem& problem, const std::vector<double>& z, const SegmentSum& first) {
  const derived_numbers& derived = problem.finger.get()->derived;
  std::vector<VectorXd> held;
  for (std::size_t j = 0; j < problem.joints(); ++j) {
    held.push_back(VectorXd::Zero(first.held[j].size()));
    if (derived.settings.has_initial_torque) {
      const std::int32_t column = problem.unknowns.initial_torque(j);
      held[j][residual_column] = column < 0 ? derived.initial_torque[j] : z[static_cast<std::size_t>(column)];
      if (column >= 0) {
        held[j][column + 1] = -1.0;
      }
    }
  }
  return held;
}

/* adds a segment to the sum, at whose start the bias holds `held`; leaves there what it holds at its end */
void join(const SegmentSum& segment, std::vector<VectorXd>* held, MatrixXd* sum) {
  *sum += segment.information;
  for (std::size_t j = 0; j < held->size(); ++j) {
    VectorXd& s = (*held)[j];
    auto block = sum->topLeftCorner(s.size(), s.size());
    block.selfadjointView<Eigen::Lower>().rankUpdate(s, segment.cross[j], -1.0);
    block.selfadjointView<Eigen::Lower>().rankUpdate(s, segment.squares);
    s = segment.kept * s + segment.held[j];
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
      join(*waiting_[joined_], &held_, &sum_);
      waiting_[joined_].reset();
    }
  }

  const Problem& problem_;
  const std::vector<double>& z_;
  const std::vector<double> numbers_;
  std::vector<BiasGains> gains_;
  std::vector<Task> tasks_;
  std::vector<std::unique_ptr<SegmentSum>> waiting_;
  std::vector<VectorXd> held_;
  MatrixXd sum_;
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
  result.complete = true;
  return result;
}

}  // namespace tendonfmu::estimation
