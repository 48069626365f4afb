// Which working points are in force at a joint angle.
#include <gtest/gtest.h>

#include <limits>

#include "core_inside.h"
#include "test_finger.h"

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// edge before joint 2: tendon 1 has working points at −0.5, 0.1, 0.6 rad, tendon 2 has no friction there
std::size_t segment(std::size_t tendon, double angle) {
  const test_finger::Finger finger;
  return slot_segment(finger, 1, tendon, angle);
}

TEST(SlotSegment, CountsTheWorkingPointsAtOrBelowTheAngle) {
  EXPECT_EQ(segment(0, -0.6), 0u);
  EXPECT_EQ(segment(0, -0.5), 1u); /* a working point begins its segment */
  EXPECT_EQ(segment(0, 0.0999), 1u);
  EXPECT_EQ(segment(0, 0.1), 2u);
  EXPECT_EQ(segment(0, 0.6), 3u);
  EXPECT_EQ(segment(0, 7.0), 3u);
}

// a joint angle overflows before the sample is refused: no law beyond those of the edge may be read
TEST(SlotSegment, OfAnInfiniteAngleIsOneOfTheEdge) {
  EXPECT_EQ(segment(0, infinity), 3u);
  EXPECT_EQ(segment(0, -infinity), 0u);
  EXPECT_EQ(segment(1, infinity), 0u);
  EXPECT_EQ(segment(1, -infinity), 0u);
  EXPECT_EQ(segment(1, std::numeric_limits<double>::quiet_NaN()), 0u);
}

}  // namespace
