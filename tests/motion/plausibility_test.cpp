#include "duet/motion/plausibility.h"

#include <gmock/gmock.h>

#include <functional>
#include <numbers>

#include "duet/core/require.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/motion/fifteen_joints.h"
#include "tests/motion/npz_edit.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

InteractionClip synthetic(Task task = Task::kHandshake, int index = 0) {
  SynthesisOptions options;
  options.index = index;
  return synthesize(task, options);
}

// Every joint of both people, changed.
InteractionClip changed(InteractionClip clip, const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& change) {
  for (HumanMotion* person : {&clip.a, &clip.b}) {
    person->rotations.clear();
    for (int t = 0; t < person->frames(); ++t)
      for (int j = 0; j < kSmplJoints; ++j) person->joints.at(t, j) = change(Eigen::Vector3d(person->joints.at(t, j)));
  }
  return clip;
}

std::string refusal(const InteractionClip& clip) {
  const Npz npz = Npz::parse(clip_bytes(clip), "people.npz");
  return thrown_message<InputError>([&] { (void)read_foreign_clip(npz); });
}

TEST(Plausibility, SyntheticPeopleAreBeyondDoubt) {
  for (const Task task : all_tasks())
    for (int index = 0; index < 5; ++index) {
      const Plausibility found = judge_people(synthetic(task, index));
      EXPECT_THAT(found.faults, IsEmpty()) << to_string(task) << " " << index;
      EXPECT_THAT(found.oddities, IsEmpty()) << to_string(task) << " " << index;
    }
}

TEST(Plausibility, MillimetresAreRefusedAndNamed) {
  const std::string message = refusal(changed(synthetic(), [](const auto& p) { return 1000.0 * p; }));
  EXPECT_SENTENCE(message);
}

TEST(Plausibility, AYUpClipIsRefused) {
  const std::string message =
      refusal(changed(synthetic(), [](const auto& p) { return Eigen::Vector3d(p.x(), p.z(), -p.y()); }));
  EXPECT_SENTENCE(message);
}

TEST(Plausibility, AMirroredClipIsRefused) {
  EXPECT_SENTENCE(refusal(changed(synthetic(), [](const auto& p) { return Eigen::Vector3d(p.x(), -p.y(), p.z()); })));
  EXPECT_THAT(judge_people(mirrored(synthetic())).faults, IsEmpty()) << "mirrored with its names it is right";
}

TEST(Plausibility, AFloorThreeMetresAboveThePeopleIsRefusedAndAStepIsNoted) {
  const auto lowered = [](double by) {
    return changed(synthetic(), [by](const auto& p) { return Eigen::Vector3d(p.x(), p.y(), p.z() - by); });
  };
  EXPECT_SENTENCE(refusal(lowered(3.0)));
  const Plausibility found = judge_people(lowered(0.3));
  EXPECT_THAT(found.faults, IsEmpty());
  ASSERT_EQ(found.oddities.size(), 2u);
  EXPECT_SENTENCE(found.oddities[0]);
}

TEST(Plausibility, ACamerasTiltIsNoted) {
  const Eigen::AngleAxisd tilt(15.0 * std::numbers::pi / 180.0, Eigen::Vector3d::UnitX());
  const Plausibility found = judge_people(changed(synthetic(), [&](const auto& p) { return tilt * p; }));
  ASSERT_FALSE(found.oddities.empty());
  EXPECT_SENTENCE(found.oddities[0]);
}

TEST(Plausibility, PeopleBackToBackInTheActAreNoted) {
  InteractionClip clip = synthetic();
  std::swap(clip.a.joints, clip.b.joints);  // the two change places and keep their headings: turn each about itself
  for (HumanMotion* person : {&clip.a, &clip.b})
    for (int t = 0; t < person->frames(); ++t) {
      const Eigen::Vector3d pelvis = person->joints.at(t, kPelvis);
      for (int j = 0; j < kSmplJoints; ++j) {
        Eigen::Vector3d p = person->joints.at(t, j);
        p.head<2>() = 2.0 * pelvis.head<2>() - p.head<2>();
        person->joints.at(t, j) = p;
      }
    }
  const Plausibility found = judge_people(clip);
  EXPECT_THAT(found.faults, IsEmpty());
  EXPECT_SENTENCE(found.oddities);
}

TEST(Plausibility, PeopleAtOnePlaceAndContactsThatAreMetresApartAreRefused) {
  InteractionClip one_place = synthetic();
  one_place.b = one_place.a;
  EXPECT_SENTENCE(refusal(one_place));
  InteractionClip far = synthetic();
  ASSERT_FALSE(far.contacts.empty());
  for (int t = 0; t < far.frames(); ++t)
    for (int j = 0; j < kSmplJoints; ++j) far.b.joints.at(t, j).x() += 100.0;
  EXPECT_SENTENCE(refusal(far));
  far.contacts.clear();
  const Plausibility found = judge_people(far);
  EXPECT_THAT(found.faults, IsEmpty());
  EXPECT_SENTENCE(found.oddities);
}

TEST(Plausibility, AFaultThatIsTakenIsNoted) {
  const InteractionClip giants = changed(synthetic(), [](const auto& p) { return 2.0 * p; });
  const ImportedClip read = read_foreign_clip(Npz::parse(clip_bytes(giants), "giants.npz"), Implausible::kAllowed);
  ASSERT_EQ(read.notes.size(), 2u);
  EXPECT_SENTENCE(read.notes[0]);
  EXPECT_EQ(read.clip.a.joints, giants.a.joints);
}

// Boundaries that are proposed for clips whose true ones are known.
TEST(Plausibility, AClipWithoutPhasesGetsProposedOnesAndSaysSo) {
  constexpr double kWorst = 1.6;  // [s]; docs/conventions.md: late by 0.3 to 1 s on average
  for (const Task task : all_tasks())
    for (int index = 0; index < 3; ++index) {
      const InteractionClip clip = synthetic(task, index);
      const Npz npz = Npz::parse(test::without_key(clip_bytes(clip), "phases"), "bare.npz");
      const ImportedClip read = read_foreign_clip(npz);
      ASSERT_EQ(read.notes.size(), 1u);
      EXPECT_THAT(read.notes[0], HasSubstr("'bare.npz': phases: act ["));
      EXPECT_THAT(read.notes[0], HasSubstr("(proposed)"));
      EXPECT_EQ(read.clip.source.at("phases"), "proposed");
      const double late = (read.clip.phases.act_begin - clip.phases.act_begin) / clip.rate_hz(),
                   long_by = (read.clip.phases.act_end - clip.phases.act_end) / clip.rate_hz();
      EXPECT_LT(std::abs(late), kWorst) << to_string(task) << " " << index << ": begins " << late << " s late";
      EXPECT_LT(std::abs(long_by), kWorst) << to_string(task) << " " << index << ": ends " << long_by << " s late";
    }
}

TEST(Plausibility, ForeignClipOfTwoLengthsIsRefusedBeforePhasesAreProposed) {
  const Npz npz = Npz::parse(
      test::edited(test::without_key(clip_bytes(changed(synthetic(), [](const auto& p) { return Eigen::Vector3d(p); })),
                                     "phases"),
                   [](Npz& bytes) {
                     const PointTracks joints = bytes.tracks("b_joints", kSmplJoints);
                     bytes.set("b_joints", joints.slice(0, joints.frames() - 1));
                   }),
      "lengths.npz");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)read_foreign_clip(npz); }));
}

TEST(Plausibility, RecordedPeopleThatAreLevelledLoad) {
  const std::string folder = test::shared_file("data/sbu");
  if (folder.empty()) GTEST_SKIP() << "not run: shared data/sbu absent";
  std::vector<test::FifteenJoints> recordings;
  for (const std::string& file : test::sbu_files(folder)) recordings.emplace_back(file);
  ASSERT_EQ(recordings.size(), 282u);
  const Eigen::Quaterniond level = test::camera_tilt(recordings);
  int odd = 0;
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const InteractionClip clip = test::clip_of(recordings[i], level, std::to_string(i), Task::kHandshake);
    const std::string bytes = test::without_key(clip_bytes(clip), "phases");
    const ImportedClip read = read_foreign_clip(Npz::parse(bytes, clip.id));
    odd += read.notes.size() > 1 ? 1 : 0;
    EXPECT_LT(read.clip.phases.act_begin, read.clip.phases.act_end);
  }
  EXPECT_LE(odd, 60) << "of 282 recordings have a note besides the phases";
  const InteractionClip mirror = changed(test::clip_of(recordings[14], level, "mirror", Task::kHandshake),
                                         [](const auto& p) { return Eigen::Vector3d(p.x(), -p.y(), p.z()); });
  EXPECT_SENTENCE(judge_people(mirror).faults);
}

}  // namespace
}  // namespace duet
