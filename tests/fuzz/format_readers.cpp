// Robot motions of other tools: every row of formats/robot_motion_format.h.
#include <map>

#include "duet/core/require.h"
#include "tests/formats/known_motion.h"
#include "tests/fuzz/archive_edit.h"
#include "tests/fuzz/reader.h"

namespace duet::fuzz {
namespace {

const RobotModel& g1() {
  static const RobotModel robot = load_robot(card_path("g1"));
  return robot;
}

// Two frames: the shortest that is a motion.
std::string written(const char* format) {
  return robot_motion_files(test::known_motion(g1(), 2), g1(), robot_motion_format(format), {.rate_hz = 50.0}).at("");
}

// A motion that was read can be written, whatever the format.
void read_motion(std::string_view bytes, const std::string& name) {
  const RobotMotionFile file =
      read_robot_motion(motion_source(std::string(bytes), name), g1(), {.motion = name == "fuzz.npz" ? "0" : ""});
  (void)robot_motion_files(file.motion, g1(), robot_motion_format("unitree"), {.rate_hz = file.motion.rate_hz});
}

std::vector<std::string> archives() {
  const RobotMotion motion = test::known_motion(g1(), 2);
  return {written("beyondmimic"),
          written("holosoma"),
          written("duet"),
          test::omniretarget_stand_in(motion, g1()),
          test::locomujoco_stand_in(motion, g1()),
          test::spider_stand_in(motion, g1())};
}

// The archives, and edits of one of them that the first byte chooses.
std::string archive_sample(unsigned seed) {
  static const std::vector<std::string> samples = archives();
  const std::size_t chosen = seed % (2 * samples.size());
  if (chosen < samples.size()) return samples[chosen];
  std::string program(kEdit);
  program += static_cast<char>(chosen - samples.size());
  return program;
}

void read_archive(std::string_view bytes) {
  static const std::vector<std::string> samples = archives();
  if (!bytes.starts_with(kEdit)) return read_motion(bytes, "fuzz.npz");
  const std::size_t chosen = bytes.size() > kEdit.size() ? static_cast<unsigned char>(bytes[kEdit.size()]) : 0;
  const Npz sample = Npz::parse(samples[chosen % samples.size()], "sample");
  const std::string_view program = bytes.substr(std::min(bytes.size(), kEdit.size() + 1));
  read_motion(edited_archive(sample, program), "fuzz.npz");
}

std::string pickle_sample(unsigned seed) { return written(seed % 2 == 0 ? "gmr" : "phc"); }
void read_pickled(std::string_view bytes) { read_motion(bytes, "fuzz.pkl"); }

std::string table_sample(unsigned seed) {
  constexpr const char* kTables[] = {"unitree", "bones", "hhtools"};
  return written(kTables[seed % 3]);
}
void read_table(std::string_view bytes) { read_motion(bytes, "fuzz.csv"); }

std::string array_sample(unsigned /*seed*/) { return test::phuma_stand_in(test::known_motion(g1(), 2), g1()); }
void read_array(std::string_view bytes) { read_motion(bytes, "fuzz.npy"); }

constexpr const char* kFolderFiles[] = {"joint_pos.csv", "body_pos.csv", "body_quat.csv", "metadata.txt"};

std::string folder_sample(unsigned /*seed*/) {
  const MotionFiles files = robot_motion_files(test::known_motion(g1(), 2), g1(), robot_motion_format("sonic"));
  std::string bytes;
  for (const char* name : kFolderFiles) {
    if (!bytes.empty()) bytes += kSeparator;
    bytes += files.at(name);
  }
  return bytes;
}

void read_folder(std::string_view bytes) {
  const std::vector<std::string_view> content = parts(bytes, std::size(kFolderFiles));
  MotionFiles files;
  for (std::size_t i = 0; i < content.size(); ++i) files[kFolderFiles[i]] = std::string(content[i]);
  (void)read_robot_motion(test::source_of(files, "fuzz"), g1());
}

}  // namespace

std::vector<Reader> format_readers() {
  return {{"robot_archive", archive_sample, read_archive},
          {"robot_pickle", pickle_sample, read_pickled},
          {"robot_table", table_sample, read_table},
          {"robot_array", array_sample, read_array},
          {"robot_folder", folder_sample, read_folder}};
}

}  // namespace duet::fuzz
