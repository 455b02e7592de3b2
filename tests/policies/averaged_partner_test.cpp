// A policy behind the filter is shown the partner's mean over a history at every frame, and its own state as it was.
#include "duet/policies/averaged_partner.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "duet/core/numbers.h"
#include "tests/policies/fixtures.h"

namespace duet {
namespace {

using Partner = Eigen::Matrix<double, 3, kSmplJoints>;

// Keeps what it was shown last.
class Witness final : public Policy {
 public:
  explicit Witness(std::vector<ObservationFrame>& shown) : shown_(shown) {}
  [[nodiscard]] std::string_view name() const override { return "witness"; }
  void reset(const EpisodeContext&) override {}
  Anchors act(const Observation& observation) override {
    keep(observation);
    return {};
  }
  [[nodiscard]] bool corrects() const override { return true; }
  void correct(const Observation& observation, Reference&) override { keep(observation); }

 private:
  void keep(const Observation& observation) { shown_.assign(observation.history.begin(), observation.history.end()); }
  std::vector<ObservationFrame>& shown_;
};

// A partner who is elsewhere at every tick, and a robot that moves on.
std::vector<ObservationFrame> seen_frames(int count) {
  Random random(7, 1);
  std::vector<ObservationFrame> frames(static_cast<std::size_t>(count));
  for (int tick = 0; tick < count; ++tick) {
    frames[tick].robot = test::g1()->standing_state({Eigen::Quaterniond::Identity(), {0.01 * tick, 0.0, 0.8}});
    for (Eigen::Index k = 0; k < frames[tick].partner.size(); ++k) frames[tick].partner.data()[k] = random.normal();
  }
  return frames;
}

// The mean of the frames up to that tick, the first one repeated before it.
Partner mean_until(const std::vector<ObservationFrame>& frames, int tick) {
  Partner mean = Partner::Zero();
  for (int t = tick - kHistoryFrames + 1; t <= tick; ++t) mean += frames[std::max(t, 0)].partner / kHistoryFrames;
  return mean;
}

struct Filtered {
  std::vector<ObservationFrame> shown;
  std::unique_ptr<Policy> policy = with_averaged_partner(std::make_unique<Witness>(shown));

  void plan(const std::vector<ObservationFrame>& frames, int tick) {
    const std::vector<ObservationFrame> history = history_of(frames, tick);
    (void)policy->plan({history, tick});
  }
  void correct(const std::vector<ObservationFrame>& frames, int tick) {
    const std::vector<ObservationFrame> history = history_of(frames, tick);
    Reference reference;
    policy->correct({history, tick}, reference);
  }
  static std::vector<ObservationFrame> history_of(const std::vector<ObservationFrame>& frames, int tick) {
    std::vector<ObservationFrame> history;
    for (int t = tick - kHistoryFrames + 1; t <= tick; ++t) history.push_back(frames[std::max(t, 0)]);
    return history;
  }
  void expect_means(const std::vector<ObservationFrame>& frames, int tick) const {
    ASSERT_EQ(shown.size(), static_cast<std::size_t>(kHistoryFrames));
    for (int i = 0; i < kHistoryFrames; ++i) {
      const int at = tick - kHistoryFrames + 1 + i;
      EXPECT_TRUE(shown[i].partner.isApprox(mean_until(frames, at), 1e-12)) << "tick " << tick << ", frame " << i;
      EXPECT_EQ(shown[i].robot.X_WB.p, frames[std::max(at, 0)].robot.X_WB.p);
    }
  }
};

TEST(AveragedPartner, ShowsTheMeanAtEveryFrameOfAHistory) {
  const std::vector<ObservationFrame> frames = seen_frames(80);
  Filtered filtered;
  for (int tick = 0; tick < 80; tick += kTicksPerPlan) {
    filtered.plan(frames, tick);
    filtered.expect_means(frames, tick);
  }
}

TEST(AveragedPartner, ShowsTheSameWhetherItCorrectsInBetweenOrNot) {
  const std::vector<ObservationFrame> frames = seen_frames(60);
  Filtered filtered;
  for (int tick = 0; tick < 60; ++tick) {
    if (tick % kTicksPerPlan == 0) filtered.plan(frames, tick);
    filtered.correct(frames, tick);
    filtered.expect_means(frames, tick);
  }
}

TEST(AveragedPartner, TakesThePartnerToHaveBeenWhereAGapEnds) {
  std::vector<ObservationFrame> frames = seen_frames(100);
  Filtered filtered;
  filtered.plan(frames, 0);
  filtered.plan(frames, 40);
  for (int tick = 0; tick < 40 - kHistoryFrames + 1; ++tick) frames[tick].partner = frames[29].partner;
  filtered.expect_means(frames, 40);
  filtered.plan(frames, 99);
  for (int tick = 0; tick < 88; ++tick) frames[tick].partner = frames[88].partner;
  filtered.expect_means(frames, 99);
}

TEST(AveragedPartner, ForgetsAtAReset) {
  const std::vector<ObservationFrame> before = seen_frames(30);
  std::vector<ObservationFrame> after = seen_frames(31);
  after.erase(after.begin());
  Filtered filtered;
  filtered.plan(before, 5);
  filtered.policy->reset({});
  filtered.plan(after, 6);
  filtered.expect_means(after, 6);
}

}  // namespace
}  // namespace duet
