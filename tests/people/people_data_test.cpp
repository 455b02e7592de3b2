// Readers of people on files that are there: the public stand-ins of examples/data, and the recordings of the shared
// data.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/motion/people/made_up.h"
#include "duet/motion/people/people_files.h"
#include "duet/motion/plausibility.h"
#include "duet/people/bvh/bvh.h"
#include "duet/people/formats/people_formats.h"
#include "tests/motion/people_files.h"
#include "tests/retarget/fixtures.h"
#include "tests/retarget/retarget_laws.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::expect_laws;

namespace fs = std::filesystem;

const std::string kExamples = DUET_SOURCE_DIR "/examples/data";

// Sines differ in their last bits between mathematics libraries: what is held to bytes is held to them on x86-64 alone.
#if defined(__x86_64__)
constexpr bool kSinesOfTheExamples = true;
#else
constexpr bool kSinesOfTheExamples = false;
#endif

// With DUET_WRITE_EXAMPLES=1 it writes them instead.
TEST(PeopleExamples, AreWhatTheWriterWrites) {
  const bool write = std::getenv("DUET_WRITE_EXAMPLES") != nullptr;
  std::vector<std::string> expected = {"README.md"};
  std::size_t bytes = 0;
  for (const test::StandinFile& file : test::example_files()) {
    if (write) write_file(kExamples + "/" + file.path, file.bytes);
    // Not EXPECT_EQ: of binary files it prints what a terminal takes for orders.
    if (kSinesOfTheExamples) {
      EXPECT_TRUE(read_file(kExamples + "/" + file.path) == file.bytes) << file.path;
    }
    expected.push_back(file.path);
    bytes += file.bytes.size();
  }
  EXPECT_LT(bytes, 300'000U);
  std::vector<std::string> found;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(kExamples))
    if (entry.is_regular_file()) found.push_back(fs::relative(entry.path(), kExamples).string());
  // Those of body_formats_test.cpp and of the robots' formats are their own tests'.
  std::erase_if(found,
                [](const std::string& path) { return path.starts_with("people/") || path.starts_with("robot/"); });
  EXPECT_THAT(found, ::testing::UnorderedElementsAreArray(expected));
}

double number_in(const std::vector<std::string>& evidence, const std::string& begin, const std::string& before) {
  for (const std::string& sentence : evidence) {
    if (!sentence.starts_with(begin)) continue;
    const std::size_t at = sentence.find(before);
    if (at != std::string::npos) return std::atof(sentence.c_str() + at + before.size());
  }
  return std::nan("");
}

// Sentences that begin so; how many recordings have each ending.
int count_of(const std::vector<std::vector<std::string>>& all, const std::string& part) {
  int count = 0;
  for (const std::vector<std::string>& evidence : all)
    for (const std::string& sentence : evidence)
      if (sentence.find(part) != std::string::npos) {
        ++count;
        break;
      }
  return count;
}

// All 282 recordings of SBU: a camera that looked down by about 10 degrees, a floor that is nowhere near 0.
TEST(PeopleData, SbuIsReadLevelledAndPutOnTheFloor) {
  const std::string folder = test::shared_file("data/sbu");
  if (folder.empty()) GTEST_SKIP() << "not run: data/sbu absent";
  const std::vector<std::string> paths = {folder};
  const PeopleFormat& format = find_people_format(paths);
  EXPECT_EQ(format.name, "positions");
  PeopleOptions options;
  options.task = Task::kHandshake;
  std::vector<std::vector<std::string>> evidence;
  std::vector<double> tilts, floors;
  int read = 0, refused = 0, tilted_after = 0;
  for (const ClipPlace& place : format.find(paths, options)) {
    try {
      const SourceClip found = read_source_clip(format, place, options);
      ++read;
      tilts.push_back(number_in(found.evidence, "level", "fit best is "));
      floors.push_back(number_in(found.evidence, "floor", " at "));
      for (const std::string& oddity : judge_people(found.clip).oddities)
        tilted_after += oddity.find("camera's tilt") != std::string::npos ? 1 : 0;
      evidence.push_back(found.evidence);
    } catch (const InputError& error) {
      ++refused;
      std::printf("refused: %s\n", error.what());
    }
  }
  std::printf(
      "read %d, refused %d; tilt %.1f degrees (10 %% %.1f, 90 %% %.1f), floor %.2f m (%.2f to %.2f); levelled %d, "
      "mirrored %d, backs turned %d, gaps %d, tilted after %d\n",
      read, refused, quantile(tilts, 0.5), quantile(tilts, 0.1), quantile(tilts, 0.9), quantile(floors, 0.5),
      quantile(floors, 0.0), quantile(floors, 1.0), count_of(evidence, "level: turned"),
      count_of(evidence, "left and right are exchanged: the"), count_of(evidence, "turn their backs"),
      count_of(evidence, "gaps:"), tilted_after);
  EXPECT_EQ(read, 282);
  EXPECT_EQ(count_of(evidence, "up axis: +z"), 282);
  EXPECT_EQ(count_of(evidence, "skeleton: kinect-15"), 282);
  EXPECT_EQ(count_of(evidence, "unit: 1 m, metre"), 282);
  EXPECT_EQ(count_of(evidence, "left and right are exchanged: the"), 0);
  EXPECT_NEAR(quantile(tilts, 0.5), 10.0, 1.5);
}

TEST(PeopleData, SbusLabelsAreTasks) {
  const std::string folder = test::shared_file("data/sbu");
  if (folder.empty()) GTEST_SKIP() << "not run: data/sbu absent";
  const std::vector<std::string> paths = {folder};
  const PeopleFormat& format = find_people_format(paths);
  int handshakes = 0, hugs = 0;
  for (const ClipPlace& place : format.find(paths, {})) {
    const RawPeople people = format.read(place, {});
    handshakes += people.task == Task::kHandshake ? 1 : 0;
    hugs += people.task == Task::kHug ? 1 : 0;
  }
  EXPECT_EQ(handshakes, 18);
  EXPECT_EQ(hugs, 21);
}

// One person a recording: of each the first, as the makers' tables have him alone.
TEST(PeopleData, WavesAndBowsOfOnePersonAreReadBesideAStillPartner) {
  const std::string folder = test::shared_file("data/kinder");
  if (folder.empty()) GTEST_SKIP() << "not run: data/kinder absent";
  const test::ScratchFolder scratch;
  int files = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".npz") continue;
    const std::vector<std::string> both = {entry.path().string()};
    RawPeople people = find_people_format(both).read({.id = "k", .files = both, .entry = ""}, {});
    write_file(scratch / (entry.path().stem().string() + ".csv"), test::csv_of(people, {0}, people.rate_hz));
    ++files;
  }
  PeopleOptions options;
  options.still_partner = true;
  const std::vector<std::string> paths = {scratch / ""};
  const PeopleFormat& format = find_people_format(paths);
  int read = 0;
  for (const ClipPlace& place : format.find(paths, options)) {
    options.task = place.id.find("bow") == std::string::npos ? Task::kWave : Task::kBend;
    try {
      const SourceClip found = read_source_clip(format, place, options);
      EXPECT_NEAR(made_up_of(found.clip.source).at("partner"), 1.0, 0.0);
      ++read;
    } catch (const InputError& error) {
      ADD_FAILURE() << error.what();
    }
  }
  EXPECT_EQ(files, 30);
  EXPECT_EQ(read, 30);
}

// Eight joints of the upper body, as a tracker of hands and heads keeps them.
TEST(PeopleData, AnArchiveOfUpperBodiesIsReadWithLegs) {
  const test::ScratchFolder scratch;
  JointLayout eight{.name = "eight", .names = {"head", "neck"}, .smpl = {}};
  for (const char* part : {"shoulder", "elbow", "hand"})
    for (const char* side : {"left_", "right_"}) eight.names.push_back(std::string(side) + part);
  const JointLayout layout = layout_of_names(eight.name, eight.names, Legs::kMadeUp);
  const RawPeople people = test::standin_people(test::standin_clip(40, 30.0), layout);
  std::vector<double> values;
  for (int t = 0; t < 40; ++t)
    for (const PointTracks& joints : people.joints)
      for (int k = 0; k < 8; ++k)
        for (int axis = 0; axis < 3; ++axis) values.push_back(joints.at(t, k)[axis]);
  Npz npz;
  npz.set("positions", std::move(values), {40, 2, 8, 3});
  npz.set("joints", eight.names);
  npz.set_number("rate_hz", 30.0);
  npz.set_text("label", "handshake");
  npz.save(scratch / "upper.npz");
  const std::vector<std::string> paths = {scratch / "upper.npz"};
  const PeopleFormat& format = find_people_format(paths);
  const SourceClip found = read_source_clip(format, format.find(paths, {}).at(0), {});
  EXPECT_EQ(made_up_kinds(found.clip.source), "legs");
  EXPECT_EQ(found.clip.frames(), 66);
  // Without names of its own the same from a list of them.
  write_file(scratch / "names.txt", fmt::format("{}\n", fmt::join(eight.names, "\n")));
  PeopleOptions options;
  options.skeleton = scratch / "names.txt";
  EXPECT_EQ(read_source_clip(format, format.find(paths, options).at(0), options).clip.a.joints, found.clip.a.joints);
}

// Stand-ins have the quirks that are known; the makers' files have the others. DUET_MAKERS_FILES names a folder of
// them: every BVH file below is read as a person beside himself, every .skeleton as two people.
TEST(PeopleData, FilesOfTheMakersAreRead) {
  const char* folder = std::getenv("DUET_MAKERS_FILES");
  if (folder == nullptr || !fs::is_directory(folder)) GTEST_SKIP() << "not run: the folder DUET_MAKERS_FILES absent";
  int read = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    const std::string path = entry.path().string(), ending = entry.path().extension().string();
    if (ending != ".bvh" && ending != ".skeleton") continue;
    const std::vector<std::string> paths(ending == ".bvh" ? 2 : 1, path);
    PeopleOptions options;
    options.task = Task::kWave;
    try {
      const PeopleFormat& format = find_people_format(paths);
      const SourceClip found = read_source_clip(format, format.find(paths, options).at(0), options);
      EXPECT_GE(found.clip.frames(), 2) << path;
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
    }
    ++read;
  }
  EXPECT_GT(read, 0) << "no .bvh and no .skeleton below " << folder;
}

// The way through the table gives the clip of import_bvh_pair, bit for bit.
TEST(PeopleData, TheCmuPairComesAsItDid) {
  const std::string folder = test::shared_file("data/cmu_handshake");
  if (folder.empty()) GTEST_SKIP() << "not run: data/cmu_handshake absent";
  const std::vector<std::string> paths = {folder + "/18_01.bvh", folder + "/19_01.bvh"};
  PeopleOptions options;
  options.task = Task::kHandshake;
  const PeopleFormat& format = find_people_format(paths);
  const SourceClip found = read_source_clip(format, format.find(paths, options).at(0), options);
  EXPECT_EQ(clip_bytes(found.clip), clip_bytes(import_bvh_pair(paths[0], paths[1], Task::kHandshake).clip));
  std::string joints;
  for (const HumanMotion* motion : {&found.clip.a, &found.clip.b})
    joints.append(reinterpret_cast<const char*>(motion->joints.data().data()), 8 * motion->joints.data().size());
  // The digest is that of the clip that was imported before there was a table of formats.
  if (!kSinesOfTheExamples) GTEST_SKIP() << "not run: digests are of x86-64";
  EXPECT_EQ(sha256_hex(joints), "a851dc763cf69c27d9dd8313aca951418204f63aed50ccffaae59c68170b56de");
}

// The laws of retargeting over a recording of people (tests/retarget/retarget_laws_test.cpp has those over synthesis).

TEST(RetargetLaws, HoldOverARecording) {
  const std::string file = test::shared_file("data/k3hi/k3hi-shaking-1.npz");
  if (file.empty()) GTEST_SKIP() << "not run: data/k3hi absent";
  const std::vector<std::string> paths = {file};
  PeopleOptions options;
  options.task = Task::kHandshake;
  const PeopleFormat& format = find_people_format(paths);
  InteractionClip clip = read_source_clip(format, format.find(paths, options).front(), options).clip;
  for (HumanMotion* motion : {&clip.a, &clip.b}) *motion = resample(*motion, 50.0);
  clip.phases = {};
  clip.contacts.clear();
  expect_laws(clip, test::g1());
}

}  // namespace
}  // namespace duet
