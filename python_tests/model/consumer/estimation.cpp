// Would estimate and learn, which takes Eigen and threads, if the image were one.
#include <tendonfmu_estimation.hpp>

#include <cstdio>
#include <stdexcept>

using namespace tendonfmu::estimation;

int main() {
  try {
    estimator all("x", 1);
    all.fit(all.start());
  } catch (const std::invalid_argument& refused) {
    std::puts(refused.what());
  }
  try {
    make_learner("x", 1);
  } catch (const std::invalid_argument& refused) {
    std::puts(refused.what());
  }
}
