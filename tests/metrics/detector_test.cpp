#include "metrics/detector.h"

#include <gmock/gmock.h>

#include "tests/support.h"

namespace duet {
namespace {

TEST(Detector, ThresholdsAreThoseOfTableS11) { EXPECT_EQ(thresholds(Task::kBend).at("min_angle"), 0.349); }

}  // namespace
}  // namespace duet
