// The synthetic clips as they are: suites are made of them, so a number that moves here moves every published table. A
// change on purpose needs another version of the suites.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <span>

#include "duet/motion/synthesis/synthesis.h"

namespace duet {
namespace {

constexpr double kSame = 1e-6;  // far above what compilers and mathematical libraries differ by

// A weighted mean of all coordinates of a person, each frame and joint with a weight of its own [m].
double mark(const HumanMotion& person) {
  double sum = 0.0;
  for (int t = 0; t < person.joints.frames(); ++t)
    for (int j = 0; j < person.joints.points(); ++j)
      sum += std::cos(0.7 * t + 1.3 * j) * person.joints.at(t, j).dot(Eigen::Vector3d(1.0, 2.0, 3.0));
  return sum / std::sqrt(static_cast<double>(person.joints.frames()));
}

struct Record {
  int act_begin, act_end, frames;
  double a, b;
};

struct Case {
  Task task;
  int index;
  Record record;
};

const std::array<Case, 12> kRecords = {{
    {Task::kHug, 0, {319, 870, 1383, 0.022872581, 0.038999495}},
    {Task::kHug, 7, {295, 945, 1372, 0.039021411, 0.084322143}},
    {Task::kHandshake, 0, {268, 740, 1210, 0.068052673, 0.102310885}},
    {Task::kHandshake, 7, {225, 535, 919, 0.080058903, 0.067174007}},
    {Task::kHighFive, 0, {216, 379, 709, 0.012846758, 0.071422284}},
    {Task::kHighFive, 7, {232, 557, 886, 0.106285491, 0.172550821}},
    {Task::kWave, 0, {165, 540, 925, -0.088096871, 0.030954154}},
    {Task::kWave, 7, {150, 454, 751, 0.128312282, 0.186579400}},
    {Task::kBend, 0, {210, 569, 774, 0.027522364, -0.041441751}},
    {Task::kBend, 7, {173, 570, 951, 0.016226132, 0.039766761}},
    {Task::kFlyKiss, 0, {185, 678, 1041, -0.045831732, 0.007633927}},
    {Task::kFlyKiss, 7, {197, 697, 1016, -0.014864837, -0.003097514}},
}};

const std::array<Case, 16> kPeopleRecords = {{
    {Task::kHug, 1, {0, 62, 98, 0.174314343, 0.266180998}},
    {Task::kHug, 2, {24, 81, 109, -0.092824500, -0.032469066}},
    {Task::kHug, 3, {0, 46, 100, -0.005523994, -0.009770855}},
    {Task::kHug, 4, {8, 81, 126, 0.010023127, -0.019804916}},
    {Task::kHug, 0, {0, 63, 110, 0.021911116, 0.131747048}},
    {Task::kHug, 7, {0, 62, 105, 0.449931057, 0.542531810}},
    {Task::kHandshake, 0, {0, 68, 101, 0.088277301, -0.002235132}},
    {Task::kHandshake, 7, {0, 105, 141, 0.258804066, 0.369768922}},
    {Task::kHighFive, 0, {44, 178, 190, -0.041317520, -0.034467632}},
    {Task::kHighFive, 7, {44, 137, 158, 0.289118275, 0.538915267}},
    {Task::kWave, 0, {63, 252, 274, 0.250124261, 0.327020352}},
    {Task::kWave, 7, {36, 300, 310, 0.153902345, 0.379227771}},
    {Task::kBend, 0, {35, 306, 322, 0.086462429, 0.124218148}},
    {Task::kBend, 7, {32, 305, 323, -0.000169700, 0.030138763}},
    {Task::kFlyKiss, 0, {68, 254, 269, 0.032169743, 0.031974538}},
    {Task::kFlyKiss, 7, {24, 214, 226, 0.008355419, -0.052087041}},
}};

void expect_records(std::span<const Case> cases, Likeness like) {
  for (const Case& c : cases) {
    SynthesisOptions options;
    options.index = c.index;
    options.like = like;
    const InteractionClip clip = synthesize(c.task, options);
    EXPECT_EQ(clip.phases.act_begin, c.record.act_begin) << to_string(c.task) << " " << c.index;
    EXPECT_EQ(clip.phases.act_end, c.record.act_end) << to_string(c.task) << " " << c.index;
    EXPECT_EQ(clip.frames(), c.record.frames) << to_string(c.task) << " " << c.index;
    EXPECT_NEAR(mark(clip.a), c.record.a, kSame) << to_string(c.task) << " " << c.index;
    EXPECT_NEAR(mark(clip.b), c.record.b, kSame) << to_string(c.task) << " " << c.index;
  }
}

TEST(SynthesisOfRecord, ClipsAreWhatTheyWere) { expect_records(kRecords, Likeness::kScripted); }
TEST(SynthesisOfRecord, ClipsLikePeopleAreWhatTheyWere) { expect_records(kPeopleRecords, Likeness::kPeople); }

}  // namespace
}  // namespace duet
