
#include <cmath>

#include "duet/metrics/retargeting.h"
#include "tests/metrics/points.h"
#include "tests/support.h"

namespace duet {
namespace {

// Hands on a line: (T, 2, 3) with x = left[t], right[t].
PointTracks hands(const std::vector<double>& left, const std::vector<double>& right) {
  PointTracks tracks(static_cast<int>(left.size()), 2);
  for (size_t t = 0; t < left.size(); ++t) {
    tracks.at(static_cast<int>(t), 0).x() = left[t];
    tracks.at(static_cast<int>(t), 1).x() = right[t];
  }
  return tracks;
}
PointTracks all(int frames, double left, double right) {
  return hands(std::vector<double>(frames, left), std::vector<double>(frames, right));
}

void expect_counts(const ContactCounts& c, long tp, long fp, long fn, long tn) {
  EXPECT_EQ(c.tp, tp);
  EXPECT_EQ(c.fp, fp);
  EXPECT_EQ(c.fn, fn);
  EXPECT_EQ(c.tn, tn);
}

// Initiator's hands at 0 and 10; the other's left at distance d from 0, right far away.
TEST(ContactCounts, AreCountedByHand) {
  const PointTracks initiator = all(4, 0.0, 10.0);
  const PointTracks source = hands({0.1, 0.1, 0.9, 0.9}, {30, 30, 30, 30});
  const PointTracks robot = hands({0.1, 0.9, 0.1, 0.9}, {30, 30, 30, 30});
  expect_counts(contact_counts(initiator, source, initiator, robot, 0.2), 1, 1, 1, 1 + 4);
}

TEST(ContactCounts, ComparisonReadings) {
  const PointTracks initiator = all(1, 0.0, 10.0);
  const PointTracks other = all(1, 0.25, 30.0);
  MetricReadings le;
  le.contact_compare = Compare::kLe;
  expect_counts(contact_counts(initiator, other, initiator, other, 0.25), 0, 0, 0, 2);
  expect_counts(contact_counts(initiator, other, initiator, other, 0.25, le), 1, 0, 0, 1);
}

TEST(ContactCounts, MinFramesDropsShortRunsOfTruthAndPrediction) {
  const PointTracks initiator = all(6, 0.0, 10.0);
  const PointTracks source = hands({0, 0, 5, 0, 5, 5}, {30, 30, 30, 30, 30, 30});
  const PointTracks robot = hands({0, 0, 5, 0, 0, 0}, {30, 30, 30, 30, 30, 30});
  MetricReadings two;
  two.min_frames = 2;
  expect_counts(contact_counts(initiator, source, initiator, robot, 0.2), 3, 2, 0, 7);
  expect_counts(contact_counts(initiator, source, initiator, robot, 0.2, two), 2, 3, 0, 7);
  two.min_frames = 4;
  expect_counts(contact_counts(initiator, source, initiator, robot, 0.2, two), 0, 0, 0, 12);
}

MetricReadings matching(HandMatching how) {
  MetricReadings readings;
  readings.matching = how;
  return readings;
}

// In the source the hands go straight, afterwards the robot's are exchanged: its own matching finds both contacts.
TEST(ContactCounts, MatchingIsTheSourcesOrItsOwn) {
  const PointTracks initiator = all(3, 0.0, 1.0);
  const PointTracks source = all(3, 0.0, 1.0);
  const PointTracks exchanged = all(3, 1.0, 0.0);
  for (const HandMatching own :
       {HandMatching::kIndependentFrame, HandMatching::kIndependentSequence, HandMatching::kIndependentBottleneck})
    expect_counts(contact_counts(initiator, source, initiator, exchanged, 0.2, matching(own)), 6, 0, 0, 0);
  for (const HandMatching given : {HandMatching::kSourceFrame, HandMatching::kSourceSequence})
    expect_counts(contact_counts(initiator, source, initiator, exchanged, 0.2, matching(given)), 0, 0, 6, 0);
}

// Two frames straight, one crossed: one matching per sequence misses the crossed one.
TEST(ContactCounts, SequenceMatchingIsOneForTheClip) {
  const PointTracks initiator = all(3, 0.0, 1.0);
  const PointTracks other = hands({0, 0, 1}, {1, 1, 0});
  expect_counts(contact_counts(initiator, other, initiator, other, 0.2, matching(HandMatching::kIndependentFrame)), 6,
                0, 0, 0);
  expect_counts(contact_counts(initiator, other, initiator, other, 0.2, matching(HandMatching::kIndependentSequence)),
                4, 0, 0, 2);
}

// Sums prefer LR (0 + 1.5 < 0.9 + 0.9), the largest distance LL.
TEST(ContactCounts, BottleneckMinimisesTheLargestDistance) {
  PointTracks initiator(1, 2), other(1, 2);
  initiator.at(0, 1) = Eigen::Vector3d(0.0, 1.2, 0.0);
  other.at(0, 1) = Eigen::Vector3d(0.0, 0.05, 0.0);
  other.at(0, 0) = Eigen::Vector3d(0.9, 0.0, 0.0);  // LL 0.9, RR 1.15; LR 0.05, RL 1.5
  expect_counts(contact_counts(initiator, other, initiator, other, 0.2), 1, 0, 0, 1);
  expect_counts(contact_counts(initiator, other, initiator, other, 0.2, matching(HandMatching::kIndependentBottleneck)),
                0, 0, 0, 2);
}

TEST(ContactCounts, TiesPairLeftWithLeft) {
  const PointTracks initiator = all(1, 0.0, 0.0);
  const PointTracks other = all(1, 0.1, 5.0);
  // LL + RR = LR + RL: contact belongs to the left hand, so a source with the right one differs.
  const PointTracks swapped = all(1, 5.0, 0.1);
  expect_counts(contact_counts(initiator, other, initiator, swapped, 0.2), 0, 1, 1, 0);
}

TEST(ContactCounts, DoNotChangeInTheMirrorOrWithTimeReversed) {
  const auto exchange = [](const PointTracks& tracks) {
    return test::transformed(tracks.select({1, 0}),
                             [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.x(), -p.y(), p.z()); });
  };
  for (int seed = 0; seed < 10; ++seed) {
    const PointTracks a = test::random_points(30, 2, seed), b = test::random_points(30, 2, seed + 100),
                      c = test::random_points(30, 2, seed + 200), d = test::random_points(30, 2, seed + 300);
    const ContactCounts x = contact_counts(a, b, c, d, 0.9);
    const ContactCounts y = contact_counts(exchange(a), exchange(b), exchange(c), exchange(d), 0.9);
    expect_counts(y, x.tp, x.fp, x.fn, x.tn);
    const ContactCounts z = contact_counts(c, d, a, b, 0.9);  // truth and prediction exchanged
    expect_counts(z, x.tp, x.fn, x.fp, x.tn);
    EXPECT_EQ(x.tp + x.fp + x.fn + x.tn, 60);
  }
}

TEST(Classification, FromATableOfCounts) {
  const Classification c = classification({.tp = 6, .fp = 2, .fn = 4, .tn = 8});
  EXPECT_DOUBLE_EQ(c.precision, 0.75);
  EXPECT_DOUBLE_EQ(c.recall, 0.6);
  EXPECT_DOUBLE_EQ(c.f1, 2 * 0.75 * 0.6 / (0.75 + 0.6));
  EXPECT_DOUBLE_EQ(c.accuracy, 0.7);
}

TEST(Classification, ZeroDivisionReadings) {
  const ContactCounts nothing{.tn = 5};
  EXPECT_TRUE(std::isnan(classification(nothing).precision));
  EXPECT_TRUE(std::isnan(classification(nothing).recall));
  EXPECT_TRUE(std::isnan(classification(nothing).f1));
  EXPECT_EQ(classification(nothing).accuracy, 1.0);
  EXPECT_EQ(classification(nothing, ZeroDivision::kZero).precision, 0.0);
  EXPECT_EQ(classification(nothing, ZeroDivision::kOne).f1, 1.0);
  const ContactCounts missed{.fn = 3};  // no prediction: precision undefined, F1 is 0
  EXPECT_TRUE(std::isnan(classification(missed).precision));
  EXPECT_EQ(classification(missed).recall, 0.0);
  EXPECT_EQ(classification(missed).f1, 0.0);
  EXPECT_TRUE(std::isnan(classification({}).accuracy));
}

TEST(Classification, CountsAddUp) {
  ContactCounts sum{.tp = 1, .fp = 2, .fn = 3, .tn = 4};
  sum += {.tp = 10, .fp = 20, .fn = 30, .tn = 40};
  expect_counts(sum, 11, 22, 33, 44);
}

TEST(ContactCounts, RefuseBadInput) {
  const PointTracks good = all(3, 0.0, 1.0);
  const auto of = [](const auto& action) { return test::thrown_message<std::invalid_argument>(action); };
  EXPECT_SENTENCE(of([&] { (void)contact_counts(good, test::random_points(3, 3, 1), good, good, 0.2); }));
  EXPECT_SENTENCE(of([&] { (void)contact_counts(good, good, good, all(4, 0, 1), 0.2); }));
  EXPECT_SENTENCE(of([&] { (void)contact_counts(good, good, all(3, std::nan(""), 1), good, 0.2); }));
  EXPECT_SENTENCE(of([&] { (void)contact_counts(good, good, good, good, 0.0); }));
  MetricReadings none;
  none.min_frames = 0;
  EXPECT_SENTENCE(of([&] { (void)contact_counts(good, good, good, good, 0.2, none); }));
}

}  // namespace
}  // namespace duet
