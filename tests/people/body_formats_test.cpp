// The formats that hold two people as parameters of body models: each stand-in is found, read, and refused where it is
// damaged. The expected joints come from tests/people/body_files.h, by another way.
#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <numbers>

#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/people/source_clip.h"
#include "duet/people/bodies/body_model.h"
#include "duet/people/formats/inter/inter_x.h"
#include "duet/people/formats/people_formats.h"
#include "duet/people/people_format.h"
#include "tests/people/body_files.h"
#include "tests/people/body_model_files.h"
#include "tests/people/format_cases.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::BodyParameters;
using test::format_cases;
using test::FormatCase;
using test::ScratchFolder;
using test::SmallModel;
using test::stand_in_folder;
using test::stand_in_people;
using test::thrown_message;
using ::testing::HasSubstr;

constexpr double kSameJoint = 1e-6;  // [m], [1]

using Files = std::vector<std::string>;

// Files of a case in a folder of its own.
class Written {
 public:
  Written(const FormatCase& which, const BodyParameters& a, const BodyParameters& b) : which_(which) {
    for (const auto& [name, bytes] : which.files(a, b)) {
      paths.push_back(folder / name);
      write_file(paths.back(), bytes);
    }
    options.align = which.apart ? Alignment::kFloor : Alignment::kNone;
  }
  [[nodiscard]] RawPeople read() const {
    const std::vector<ClipPlace> clips = which_.format().find(paths, options);
    EXPECT_EQ(clips.size(), 1U);
    return which_.format().read(clips.at(0), options);
  }
  [[nodiscard]] std::string refusal() const {
    return thrown_message<InputError>([&] { (void)read(); });
  }

  ScratchFolder folder;
  Files paths;
  PeopleOptions options;

 private:
  const FormatCase& which_;
};

// Two people a metre apart along x, of the size that files have; where heads are up is not looked at.
std::pair<BodyParameters, BodyParameters> two_bodies(const FormatCase& which, int frames = 5) {
  return {test::body_parameters(frames, 0.4, which.body_joints, {0.0, 0.2, 0.1}),
          test::body_parameters(frames, 1.9, which.body_joints, {1.0, 0.3, -0.2})};
}

void expect_person(const RawPeople& raw, std::size_t who, const BodyParameters& body, const RestJoints& rest,
                   bool moved) {
  const test::PosedBody expected = test::posed(body, rest);
  ASSERT_EQ(raw.joints[who].frames(), body.frames);
  ASSERT_EQ(raw.rotations[who].size(), static_cast<std::size_t>(body.frames) * kSmplJoints);
  const Eigen::Vector3d shift =
      moved ? Eigen::Vector3d(raw.joints[who].at(0, 0) - expected.joints[0].col(0)) : Eigen::Vector3d::Zero();
  for (int t = 0; t < body.frames; ++t) {
    EXPECT_LT(((raw.joints[who].frame(t) - expected.joints[t]).colwise() - shift).cwiseAbs().maxCoeff(), kSameJoint);
    for (int j = 0; j < kSmplJoints; ++j) {
      const std::size_t at = static_cast<std::size_t>(kSmplJoints) * t + j;
      EXPECT_LT((raw.rotations[who][at].toRotationMatrix() - expected.rotations[at]).cwiseAbs().maxCoeff(), kSameJoint);
    }
  }
}

TEST(BodyFormats, JointsAndRotationsAreThoseOfTheParameters) {
  const SmallModel small(24);
  for (const FormatCase& which : format_cases()) {
    SCOPED_TRACE(which.name);
    const auto [a, b] = two_bodies(which);
    Written written(which, a, b);
    written.options.body_model = written.folder / "model.bin";
    small.npz().save(written.options.body_model);
    const RawPeople raw = written.read();
    const std::vector<double> none(10);
    expect_person(raw, 0, a, small.rest(which.shaped ? a.betas : none), false);
    expect_person(raw, 1, b, small.rest(which.shaped ? b.betas : none), which.apart);
    EXPECT_EQ(raw.rate_hz, which.rate_hz);
    EXPECT_EQ(raw.up, which.up);
    EXPECT_EQ(raw.source.at("format"), which.name);
    EXPECT_EQ(raw.source.at("body_model"), "SMPL");
    EXPECT_EQ(raw.source.contains("provenance"), which.apart);
    if (which.apart) {
      EXPECT_EQ(raw.source.at("provenance"), "estimated shared frame");
    }
    EXPECT_SENTENCE(raw.evidence);
  }
}

TEST(BodyFormats, NoModelFileIsNeededAndTheSourceSaysSo) {
  for (const FormatCase& which : format_cases()) {
    SCOPED_TRACE(which.name);
    const auto [a, b] = two_bodies(which);
    const RawPeople raw = Written(which, a, b).read();
    expect_person(raw, 0, a, average_body().joints, false);
    EXPECT_EQ(raw.source.at("body_model"), "none: average skeleton");
    EXPECT_SENTENCE(raw.evidence);
  }
}

// Each format knows its own files, as two files or as a folder of them, and not those of the others.
TEST(BodyFormats, EachRecognisesItsOwnFilesAlone) {
  for (const FormatCase& written_as : format_cases()) {
    const auto [a, b] = two_bodies(written_as);
    const Written written(written_as, a, b);
    for (const FormatCase& asked : format_cases()) {
      EXPECT_EQ(asked.format().recognises(written.paths), asked.name == written_as.name)
          << asked.name << " of " << written_as.name;
      if (written.paths.size() == 1) {
        const Files folder = {written.folder / ""};
        EXPECT_EQ(asked.format().recognises(folder), asked.name == written_as.name) << asked.name;
      }
    }
  }
  for (const FormatCase& asked : format_cases())
    for (const Files& none : {Files{}, Files{"/nowhere"}, Files{"/nowhere", "/nowhere/b"}})
      EXPECT_FALSE(asked.format().recognises(none)) << asked.name;
}

TEST(BodyFormats, PeopleOfTheirOwnWorldsNeedAnAlignment) {
  for (const FormatCase& which : format_cases()) {
    if (!which.apart) continue;
    const auto [a, b] = two_bodies(which);
    Written written(which, a, b);
    written.options.align = Alignment::kNone;
    EXPECT_SENTENCE(written.refusal()) << which.name;
  }
}

TEST(BodyFormats, TruncatedEmptyAndForeignFilesAreRefused) {
  for (const FormatCase& which : format_cases()) {
    SCOPED_TRACE(which.name);
    const auto [a, b] = two_bodies(which, 3);
    const Written written(which, a, b);
    const std::string good = read_file(written.paths[0]);
    std::vector<std::string> bad = {"", "hello", "PK\x03\x04 no archive", "\x80\x04", "\x93NUMPY\x01\x00"};
    for (std::size_t k = 1; k < 20; ++k) bad.push_back(good.substr(0, good.size() * k / 20));
    for (const std::string& bytes : bad) {
      write_file(written.paths[0], bytes);
      EXPECT_THAT(written.refusal(), HasSubstr(std::filesystem::path(written.paths[0]).filename().string()))
          << bytes.size();
    }
    std::filesystem::remove(written.paths[0]);
    EXPECT_SENTENCE(written.refusal());
  }
}

TEST(BodyFormats, ValuesThatAreNotFiniteAreRefused) {
  for (const FormatCase& which : format_cases())
    for (std::vector<double> BodyParameters::*part : {&BodyParameters::root, &BodyParameters::translation}) {
      auto [a, b] = two_bodies(which);
      (b.*part)[7] = NAN;
      EXPECT_SENTENCE(Written(which, a, b).refusal()) << which.name;
    }
}

TEST(BodyFormats, PeopleOfDifferentLengthAndSingleFramesAreRefused) {
  for (const FormatCase& which : format_cases()) {
    SCOPED_TRACE(which.name);
    const auto [a, b] = two_bodies(which, 5);
    const auto [one_a, one_b] = two_bodies(which, 1);
    const bool tracked = which.name == "wham" || which.name == "4d-humans";  // of these the overlap is taken
    if (!tracked && which.name != "inter-x-h5") {                            // whose people are in one array
      BodyParameters shorter = two_bodies(which, 4).second;
      EXPECT_SENTENCE(Written(which, a, shorter).refusal());
    }
    EXPECT_SENTENCE(Written(which, one_a, one_b).refusal());
  }
}

TEST(BodyFormats, MissingKeysAndWrongShapesAreNamed) {
  const BodyParameters body = test::body_parameters(3, 1.0);
  const FormatCase inter_x = format_cases()[0], amass = format_cases()[2];
  const auto refusal = [&](const FormatCase& which, const Npz& npz) {
    const Written written(which, body, body);
    npz.save(written.paths[0]);
    return written.refusal();
  };
  for (const char* key : {"root_orient", "pose_body", "trans"}) {
    Npz npz;
    for (const char* other : {"root_orient", "pose_body", "trans"})
      if (std::string(other) != key) npz.set(other, test::inter_x_npz(body).array(other));
    EXPECT_SENTENCE(refusal(inter_x, npz));
  }
  Npz npz = test::inter_x_npz(body);
  npz.set("pose_body", std::vector<double>(3 * 60), {3, 20, 3});
  EXPECT_SENTENCE(refusal(inter_x, npz));
  npz = test::inter_x_npz(body);
  npz.set("trans", std::vector<double>(12), {4, 3});
  EXPECT_SENTENCE(refusal(inter_x, npz));
  npz.set("trans", std::vector<std::string>{"a", "b", "c"});
  EXPECT_SENTENCE(refusal(inter_x, npz));
  npz = test::amass_poses_npz(body, 100.0);
  EXPECT_SENTENCE(refusal(amass, npz));
  const Npz with_rate = test::amass_poses_npz(body, 120.0);
  npz = Npz();
  for (const std::string& key : with_rate.keys())
    if (!key.starts_with("mocap_")) npz.set(key, with_rate.array(key));
  EXPECT_SENTENCE(refusal(amass, npz));
  npz = test::amass_poses_npz(body, -1.0);
  EXPECT_SENTENCE(refusal(amass, npz));
}

TEST(BodyFormats, PicklesThatNameAClassAreRefused) {
  const std::string attack = "\x80\x04}\x8c\x07person1\x8c\x02os\x8c\x06system\x93\x8c\x02id\x85Rs.";
  for (const FormatCase& which : format_cases()) {
    const auto [a, b] = two_bodies(which);
    const Written written(which, a, b);
    if (which.name == "gvhmr")
      write_file(written.paths[0], zip_bytes({{"a/data.pkl", attack}}));
    else if (written.paths.size() == 1 && which.name != "inter-x-h5")
      write_file(written.paths[0], attack);
    else
      continue;  // no pickles
    EXPECT_SENTENCE(written.refusal()) << which.name;
  }
}

// ---- stand-ins for everybody ------------------------------------------------------------

// The table asks each format in turn: none takes the files of another.
TEST(BodyFormats, TheTableFindsEachByItsStandIn) {
  for (const FormatCase& which : format_cases()) {
    const auto [a, b] = stand_in_people(which);
    Files paths;
    for (const auto& [name, bytes] : which.files(a, b)) paths.push_back(stand_in_folder(which) + "/" + name);
    EXPECT_EQ(find_people_format(paths).name, which.name);
    if (paths.size() == 1 || which.name == "inter-x") {
      const Files folder = {stand_in_folder(which)};
      EXPECT_EQ(find_people_format(folder).name, which.name);
    }
  }
}

// From the public test vectors to clips: z up, facing each other, on the floor, whatever the file's axes.
TEST(BodyFormats, StandInsBecomeClips) {
  for (const FormatCase& which : format_cases()) {
    SCOPED_TRACE(which.name);
    const auto [a, b] = stand_in_people(which);
    Files paths;
    for (const auto& [name, bytes] : which.files(a, b)) paths.push_back(stand_in_folder(which) + "/" + name);
    PeopleOptions options;
    options.task = Task::kHandshake;
    options.align = which.apart ? Alignment::kFloor : Alignment::kNone;
    const RawPeople raw = which.format().read(which.format().find(paths, options).at(0), options);
    expect_person(raw, 0, a, average_body().joints, false);
    const InteractionClip clip = clip_of(raw, options).clip;
    const Eigen::Vector3d pelvis_a = clip.a.joints.at(0, kPelvis), pelvis_b = clip.b.joints.at(0, kPelvis);
    EXPECT_NEAR((pelvis_a - pelvis_b).norm(), 0.8, 1e-3);
    const Eigen::Vector3d line = (pelvis_b - pelvis_a).normalized();
    EXPECT_GT((clip.a.rotations[kPelvis] * Eigen::Vector3d::UnitX()).dot(line), 0.98);
    EXPECT_LT((clip.b.rotations[kPelvis] * Eigen::Vector3d::UnitX()).dot(line), -0.98);
    for (const HumanMotion* person : {&clip.a, &clip.b}) {
      EXPECT_GT(person->joints.at(0, kHead).z(), 1.3);
      EXPECT_NEAR(person->joints.at(0, kLeftToe).z(), 0.02, 0.05);
      // Left is left of where the pelvis faces.
      const Eigen::Vector3d left = person->rotations[kPelvis] * Eigen::Vector3d::UnitY();
      const Eigen::Vector3d shoulders = person->joints.at(0, kLeftShoulder) - person->joints.at(0, kRightShoulder);
      EXPECT_GT(shoulders.normalized().dot(left), 0.9);
    }
  }
}

}  // namespace
}  // namespace duet
