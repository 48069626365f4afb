// Sums with the bias eliminated, against a filter that carries dense rows from sample to sample.
#include "joint_sum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using tendonfmu::estimation::block_length;
using tendonfmu::estimation::block_rows;
using tendonfmu::estimation::joint_segment;
using tendonfmu::estimation::joint_sum;

constexpr std::size_t run_first = 3, run_length = 3; /* columns that are always given together */

struct Sample {
  VectorXd row, jump;    /* [q] */
  double gain, weight;   /* 0, 0: not used */
  bool single_jump, run; /* whether the jump has columns of its own, and those of the run */
};

/* Samples of q columns, few of them in each, with a bias that starts at row `start` (0: it is there before). */
std::vector<Sample> made_samples(std::size_t count, std::size_t columns, std::size_t start, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::vector<Sample> samples;
  double variance = 0.3;
  for (std::size_t k = 0; k < count; ++k) {
    const auto zero = VectorXd::Zero(static_cast<Index>(columns));
    Sample s{zero, zero, 0.0, 0.0, uniform(random) < 0.1, uniform(random) < 0.4};
    const bool used = k > 0 && (k == start || (k > start && uniform(random) < 0.85)),
               jumps = s.single_jump || uniform(random) < 0.05;
    for (std::size_t c = 0; c < columns; ++c) {
      const bool of_run = c >= run_first && c < run_first + run_length;
      const Index at = static_cast<Index>(c);
      if (used && (c == 0 || (of_run ? s.run : uniform(random) < 0.2))) {
        s.row[at] = normal(random);
      }
      if (jumps && (of_run ? s.run : s.single_jump)) {
        s.jump[at] = 0.3 * normal(random);
      }
    }
    variance += 0.02;
    if (used && k == start) {
      s.gain = 1.0;
    } else if (used) {
      const double total = variance + 0.1 * (0.5 + uniform(random));
      s.gain = variance / total;
      s.weight = 1.0 / std::sqrt(total);
      variance *= 1.0 - s.gain;
    }
    samples.push_back(s);
  }
  return samples;
}

/* Σ ν νᵀ by the filter as it is written down: held += jump, ν = (row − held)/√S, held += K (row − held) */
MatrixXd recursive(const std::vector<Sample>& samples, VectorXd* held) {
  MatrixXd sum = MatrixXd::Zero(held->size(), held->size());
  for (const Sample& s : samples) {
    *held += s.jump;
    if (s.gain > 0.0 || s.weight > 0.0) {
      const VectorXd innovation = s.row - *held;
      sum += s.weight * s.weight * innovation * innovation.transpose();
      *held += s.gain * innovation;
    }
  }
  return sum;
}

void give(const Sample& s, joint_sum* joint) {
  const double *row = s.row.data() + run_first, *jump = s.jump.data() + run_first;
  for (Index c = 0; c < s.row.size(); ++c) {
    const bool of_run = c >= static_cast<Index>(run_first) && c < static_cast<Index>(run_first + run_length);
    if (!of_run && s.row[c] != 0.0) {
      joint->rows.add(block_rows::sample, static_cast<std::size_t>(c), s.row[c]);
    }
    if (!of_run && s.jump[c] != 0.0) {
      joint->rows.add(block_rows::bias, static_cast<std::size_t>(c), s.jump[c]);
    }
  }
  if (s.run) {
    joint->rows.add_run(block_rows::sample, run_first, run_length, row, 1.0);
    joint->rows.add_run(block_rows::bias, run_first, run_length, jump, 1.0);
  }
  if (s.gain > 0.0 || s.weight > 0.0) {
    joint->filter(s.gain, s.weight);
  }
}

/* one segment; `blocks`: how long each may be */
joint_segment summed(const std::vector<Sample>& samples, std::size_t first, std::size_t last, std::size_t blocks,
                     joint_sum* joint, MatrixXd* sum) {
  joint->begin_segment();
  for (std::size_t k = first; k < last; ++k) {
    give(samples[k], joint);
    if ((k - first + 1) % blocks == 0 || k + 1 == last) {
      joint->end_block(sum);
    }
  }
  return joint->end_segment(sum);
}

/* what a segment adds if the bias holds s at its start: every ν is ν⁰ − c·s */
void join(const joint_segment& part, VectorXd* held, MatrixXd* sum) {
  const VectorXd s = *held;
  *sum += part.squares * s * s.transpose() - s * part.cross.transpose() - part.cross * s.transpose();
  *held = part.kept * s + part.held;
}

MatrixXd full(const MatrixXd& lower) {
  return lower.selfadjointView<Eigen::Lower>();
}

double difference(const MatrixXd& a, const MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

TEST(JointSum, IsTheFiltersAtAnyBlockBoundary) {
  constexpr std::size_t columns = 11;
  const std::vector<Sample> samples = made_samples(5000, columns, 0, 1);
  VectorXd held = VectorXd::Zero(columns);
  const MatrixXd expected = recursive(samples, &held);
  for (const std::size_t blocks : {std::size_t{1}, std::size_t{7}, std::size_t{64}, block_length}) {
    joint_sum joint(columns);
    MatrixXd sum = MatrixXd::Zero(columns, columns);
    const joint_segment end = summed(samples, 0, samples.size(), blocks, &joint, &sum);
    EXPECT_LT(difference(full(sum), expected), 1e-12) << "blocks of " << blocks;
    EXPECT_LT((end.held - held).norm() / held.norm(), 1e-12) << "blocks of " << blocks;
  }
}

TEST(JointSum, SegmentsJoinToTheWhole) {
  constexpr std::size_t columns = 8;
  const std::vector<Sample> samples = made_samples(1500, columns, 450, 3);
  VectorXd expected_held = VectorXd::LinSpaced(columns, -0.4, 0.7); /* as with bias.initial_torque */
  VectorXd held = expected_held;
  const MatrixXd expected = recursive(samples, &expected_held);
  joint_sum joint(columns);
  MatrixXd total = MatrixXd::Zero(columns, columns);
  std::size_t first = 0;
  for (const std::size_t last : {std::size_t{1}, std::size_t{400}, std::size_t{777}, std::size_t{1500}}) {
    MatrixXd sum = MatrixXd::Zero(columns, columns);
    const joint_segment part = summed(samples, first, last, 100, &joint, &sum);
    total += full(sum);
    join(part, &held, &total);
    first = last;
  }
  EXPECT_LT(difference(total, expected), 1e-11);
  EXPECT_LT((held - expected_held).norm() / held.norm(), 1e-12);
}

/* a pass that is stopped leaves a block and a segment unfinished; the next one must not see them */
TEST(JointSum, ASegmentBegunAnewForgetsWhatWasLeftUnfinished) {
  constexpr std::size_t columns = 8;
  const std::vector<Sample> samples = made_samples(400, columns, 0, 5);
  joint_sum fresh(columns), used(columns);
  MatrixXd expected = MatrixXd::Zero(columns, columns), sum = expected, thrown_away = expected;
  const joint_segment first = summed(samples, 0, samples.size(), 128, &fresh, &expected);
  for (std::size_t k = 0; k < 200; ++k) {
    give(samples[k], &used);
    if (k == 99) {
      used.end_block(&thrown_away);
    }
  }
  const joint_segment second = summed(samples, 0, samples.size(), 128, &used, &sum);
  EXPECT_EQ(full(sum), full(expected));
  EXPECT_EQ(first.held, second.held);
  EXPECT_EQ(first.cross, second.cross);
  EXPECT_EQ(first.squares, second.squares);
}

}  // namespace
