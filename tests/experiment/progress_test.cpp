#include <gtest/gtest.h>

#include <cmath>

#include "duet/experiment/work/run_work.h"

namespace duet {
namespace {

TEST(Progress, DurationsReadAsPeopleSayThem) {
  EXPECT_EQ(format_duration(0.2), "0 s");
  EXPECT_EQ(format_duration(59.4), "59 s");
  EXPECT_EQ(format_duration(65.0), "1 min 05 s");
  EXPECT_EQ(format_duration(3725.0), "1 h 02 min");
}

TEST(Progress, PlainLinesSayWhatWasDone) {
  Progress progress(Progress::Style::kLines);
  testing::internal::CaptureStderr();
  progress.start("retargeting", 3, "clips");
  progress.advance(3);
  progress.finish();
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("retargeting: 3 clips"), std::string::npos) << text;
  EXPECT_NE(text.find("retargeting: 3/3 clips"), std::string::npos) << text;
}

TEST(Progress, ANoteIsALineOfItsOwn) {
  Progress progress(Progress::Style::kLines);
  testing::internal::CaptureStderr();
  progress.note("'clip.npz': phases: act [3, 9) of 20 frames (proposed)");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "'clip.npz': phases: act [3, 9) of 20 frames (proposed)\n");
}

TEST(Progress, BarReturnsToTheStartOfTheLine) {
  Progress progress(Progress::Style::kBar);
  testing::internal::CaptureStderr();
  progress.start("rolling out", 2, "episodes");
  progress.advance(1);
  progress.finish();
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("\r[############............]"), std::string::npos) << text;
}

TEST(Progress, TheTimeLeftFollowsTheWorkAndNotTheItems) {
  const auto shown_at = [](double share) {
    Progress progress(Progress::Style::kBar);
    testing::internal::CaptureStderr();
    progress.start("rolling out", 2, "episodes");
    progress.advance(1);
    progress.set_share(share);
    progress.finish();
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(shown_at(std::nan("")).find(" left"), std::string::npos);  // nobody knows yet
  EXPECT_NE(shown_at(0.5).find(", 0 s left"), std::string::npos);
  EXPECT_NE(shown_at(1e-13).find(" h "), std::string::npos);
}

TEST(Progress, QuietIsSilent) {
  Progress progress(Progress::Style::kQuiet);
  testing::internal::CaptureStderr();
  progress.note("said to nobody");
  progress.start("x", 1, "y");
  progress.advance();
  progress.finish();
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace duet
