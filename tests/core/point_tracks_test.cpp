#include <numeric>

#include "duet/core/recording.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

PointTracks counted(int frames, int points) {
  std::vector<double> data(static_cast<std::size_t>(frames * points * 3));
  std::iota(data.begin(), data.end(), 0.0);
  return {frames, points, data};
}

TEST(PointTracks, LieAsNumPyWouldLayThem) {
  const PointTracks tracks = counted(4, 5);
  for (int t = 0; t < 4; ++t)
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d expected = Eigen::Vector3d(0, 1, 2).array() + 3.0 * (5 * t + k);
      EXPECT_EQ(tracks.at(t, k), expected);
      EXPECT_EQ(tracks.frame(t).col(k), expected);
    }
}

TEST(PointTracks, FramesAreWrittenInPlace) {
  PointTracks tracks(2, 3);
  EXPECT_EQ(tracks.frame(1).norm(), 0.0);
  tracks.frame(1).col(2) << 1, 2, 3;
  EXPECT_EQ(tracks.at(1, 2), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(tracks.data()[17], 3.0);
}

TEST(PointTracks, EmptyIsASize) {
  EXPECT_TRUE(PointTracks().empty());
  EXPECT_TRUE(PointTracks(0, 24).empty());
  EXPECT_EQ(PointTracks(0, 24).points(), 24);
  EXPECT_EQ(PointTracks(3, 0).frames(), 3);
}

TEST(PointTracks, SelectKeepsTheOrderGiven) {
  const PointTracks tracks = counted(3, 4);
  const PointTracks chosen = tracks.select({3, 0, 3});
  ASSERT_EQ(chosen.points(), 3);
  for (int t = 0; t < 3; ++t) {
    EXPECT_EQ(chosen.at(t, 0), tracks.at(t, 3));
    EXPECT_EQ(chosen.at(t, 1), tracks.at(t, 0));
    EXPECT_EQ(chosen.at(t, 2), tracks.at(t, 3));
  }
  EXPECT_EQ(tracks.select({}).points(), 0);
}

TEST(PointTracks, SlicesJoinToTheWhole) {
  const PointTracks tracks = counted(5, 2);
  EXPECT_EQ(tracks.slice(0, 5), tracks);
  std::vector<double> joined = tracks.slice(0, 2).data();
  const std::vector<double> rest = tracks.slice(2, 5).data();
  joined.insert(joined.end(), rest.begin(), rest.end());
  EXPECT_EQ(joined, tracks.data());
  EXPECT_EQ(tracks.slice(3, 3).frames(), 0);
}

TEST(PointTracks, RefuseWhatDoesNotFit) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { PointTracks(-1, 2); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { PointTracks(1, 2, std::vector<double>(5)); }));
  const PointTracks tracks = counted(3, 4);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)tracks.select({1, 4}); }));
  EXPECT_THROW((void)tracks.select({-1}), std::invalid_argument);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)tracks.slice(1, 4); }));
  EXPECT_THROW((void)tracks.slice(-1, 2), std::invalid_argument);
  EXPECT_THROW((void)tracks.slice(2, 1), std::invalid_argument);
}

}  // namespace
}  // namespace duet
