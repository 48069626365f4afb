/* Would estimate and learn, which takes Eigen and threads, if the image were one. */
#include <stdio.h>
#include <tendonfmu_estimation.h>
#include <tendonfmu_learner.h>

int main(void) {
  char fit[512] = "", learn[512] = "";
  tendonfmu_estimator* estimator = tendonfmu_estimator_create("x", 1, NULL, NULL, fit, sizeof fit);
  tendonfmu_learner* learner = tendonfmu_learner_create("x", 1, NULL, NULL, NULL, learn, sizeof learn);
  if (estimator)
    tendonfmu_estimator_fit(estimator, NULL, NULL, NULL, NULL, NULL);
  tendonfmu_estimator_destroy(estimator);
  tendonfmu_learner_destroy(learner);
  return puts(fit) < 0 || puts(learn) < 0;
}
