// Faults in files of robot motions: each is refused in one sentence that names the file.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <functional>

#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/formats/pickle_output.h"
#include "duet/formats/robot_motion_format.h"
#include "tests/archives/pickle_bytes.h"
#include "tests/formats/known_motion.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::known_motion;
using test::thrown_message;
using ::testing::HasSubstr;

const RobotModel& g1() {
  static const RobotModel robot = load_robot(card_path("g1"));
  return robot;
}

std::string refusal(const std::string& bytes, const std::string& name, const RobotMotionOptions& options = {},
                    const std::string& format = "") {
  return thrown_message<InputError>(
      [&] { (void)read_robot_motion(motion_source(bytes, name), g1(), options, format); });
}

std::string file_of(const char* format) {
  return robot_motion_files(known_motion(g1()), g1(), robot_motion_format(format), {.rate_hz = 50.0}).at("");
}

// The archive of a format with one array replaced.
std::string edited(const char* format, const std::function<void(Npz&)>& edit) {
  Npz npz = Npz::parse(file_of(format), "x.npz");
  edit(npz);
  return npz.bytes();
}

std::string without(const char* format, const std::string& missing) {
  const Npz npz = Npz::parse(file_of(format), "x.npz");
  Npz rest;
  for (const std::string& key : npz.keys())
    if (key != missing) rest.set(key, npz.array(key));
  return rest.bytes();
}

std::vector<std::pair<std::string, std::string>> samples() {
  const RobotMotion motion = known_motion(g1());
  std::vector<std::pair<std::string, std::string>> files = {{"x.npy", test::phuma_stand_in(motion, g1())},
                                                            {"x.npz", test::omniretarget_stand_in(motion, g1())},
                                                            {"x.npz", test::locomujoco_stand_in(motion, g1())},
                                                            {"x.npz", test::spider_stand_in(motion, g1())}};
  for (const RobotMotionFormat& format : robot_motion_formats())
    if (format.write != nullptr && *format.ending != '\0')
      files.emplace_back(std::string("x") + format.ending, file_of(format.name));
  return files;
}

// A table that is cut at the end of a line is a shorter table; nothing else may pass.
TEST(RobotMotionBadInput, TruncatedFilesAreRefused) {
  for (const auto& [name, bytes] : samples()) {
    for (const double share : {0.01, 0.1, 0.5, 0.9, 0.999}) {
      const std::string cut = bytes.substr(0, static_cast<std::size_t>(share * static_cast<double>(bytes.size())));
      if (name == "x.csv") continue;
      EXPECT_THAT(refusal(cut, name), HasSubstr(name)) << share;
    }
    EXPECT_SENTENCE(refusal("", name));
  }
  const std::string table = file_of("unitree");
  EXPECT_SENTENCE(refusal(table.substr(0, table.size() * 9 / 10), "x.csv"));
}

TEST(RobotMotionBadInput, AWrongMagicIsRefused) {
  EXPECT_SENTENCE(refusal("PK\x03\x04 this is no archive", "x.npz"));
  EXPECT_SENTENCE(refusal("\x93NUMPY\x01", "x.npy"));
  EXPECT_SENTENCE(refusal("hello", "x.pkl"));
  EXPECT_SENTENCE(
      refusal("\x7f"
              "ELF\x01",
              "x.npz"));
}

// A header that claims more than there is: no memory is taken for it.
TEST(RobotMotionBadInput, HugeHeadersAreRefused) {
  std::string npy = test::phuma_stand_in(known_motion(g1()), g1());
  const std::size_t shape = npy.find("(12, 30)");
  ASSERT_NE(shape, std::string::npos);
  std::string huge = npy;
  huge.replace(shape, 8, "(1<<40,)");
  EXPECT_SENTENCE(refusal(huge, "x.npy"));
  huge = npy;
  huge.replace(shape, 8, "(9999,9)");
  EXPECT_SENTENCE(refusal(huge, "x.npy"));
  test::PickleWriter pickle;
  pickle.raw("}(").text("root_pos").raw("\x8e\xff\xff\xff\xff\xff\xff\xff\x0fu.");
  EXPECT_SENTENCE(refusal(pickle.str(), "x.pkl"));
}

TEST(RobotMotionBadInput, MissingKeysAreNamed) {
  EXPECT_SENTENCE(refusal(without("beyondmimic", "body_quat_w"), "x.npz"));
  EXPECT_SENTENCE(refusal(without("beyondmimic", "joint_pos"), "x.npz"));
  EXPECT_SENTENCE(refusal(without("holosoma", "body_pos_w"), "x.npz"));
  EXPECT_SENTENCE(refusal(without("holosoma", "body_pos_w"), "x.npz", {}, "holosoma"));
  std::string bones = file_of("bones");
  bones.replace(bones.find("root_rotateY"), 12, "root_rotatey");
  EXPECT_SENTENCE(refusal(bones, "x.csv"));
  PickleOutput phc;
  phc.begin_dict().key("walk").begin_dict().key("root_trans_offset").array({2, 3}, std::vector<double>(6));
  EXPECT_SENTENCE(refusal(phc.end_dict().end_dict().finish(), "x.pkl"));
}

TEST(RobotMotionBadInput, WrongTypesAndShapesAreRefused) {
  const auto beyondmimic = [](const std::string& key, NpyArray array) {
    return refusal(edited("beyondmimic", [&](Npz& npz) { npz.set(key, array); }), "x.npz");
  };
  EXPECT_SENTENCE(beyondmimic("joint_pos", {{2}, std::vector<std::string>{"a", "b"}}));
  EXPECT_SENTENCE(beyondmimic("body_pos_w", {{12, 30, 2}, std::vector<double>(720)}));
  EXPECT_SENTENCE(beyondmimic("body_pos_w", {{11, 30, 3}, std::vector<double>(990)}));
  EXPECT_SENTENCE(beyondmimic("body_quat_w", {{12, 29, 4}, std::vector<double>(12 * 29 * 4)}));
  EXPECT_SENTENCE(beyondmimic("fps", {{1}, std::vector<double>{0.0}}));
  EXPECT_SENTENCE(beyondmimic("joint_names", {{1}, std::vector<std::string>{"a"}}));
  EXPECT_SENTENCE(refusal(npy_bytes({{3, 30}, std::vector<std::int64_t>(90)}), "x.npy"));
  EXPECT_SENTENCE(refusal(npy_bytes({{90}, std::vector<double>(90)}), "x.npy"));
  EXPECT_SENTENCE(refusal(file_of("unitree"), "x.csv", {}, "phuma"));
  EXPECT_SENTENCE(refusal(file_of("unitree"), "x.csv", {.rate_hz = -1.0}));
  EXPECT_SENTENCE(refusal(file_of("unitree"), "x.csv", {.metres = 0.0}));
}

// A rate that would make more frames than a memory holds.
TEST(RobotMotionBadInput, EndlessMotionsAreRefused) {
  EXPECT_SENTENCE(refusal(file_of("unitree"), "x.csv", {.rate_hz = 1e-300}));
  EXPECT_SENTENCE(refusal(file_of("unitree"), "x.csv", {.rate_hz = std::nan("")}));
  std::string table;
  for (int t = 0; t < 10'000; ++t) table += "0,0,0.8,0,0,0,1,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n";
  EXPECT_SENTENCE(refusal(table, "x.csv", {.rate_hz = 0.1}));
}

TEST(RobotMotionBadInput, ValuesThatAreNotFiniteAreRefused) {
  EXPECT_SENTENCE(refusal(edited("holosoma",
                                 [](Npz& npz) {
                                   NpyArray array = npz.array("joint_pos");
                                   std::get<std::vector<double>>(array.values)[40] = std::nan("");
                                   npz.set("joint_pos", array);
                                 }),
                          "x.npz"));
  std::string table = file_of("unitree");
  table.replace(0, table.find(','), "nan");
  EXPECT_SENTENCE(refusal(table, "x.csv"));
  std::vector<double> rows(2 * 30, 0.0);
  rows[5] = std::nan("");
  EXPECT_SENTENCE(refusal(npy_bytes({{2, 30}, rows}), "x.npy"));
  rows[5] = 0.0;
  rows[24] = INFINITY;
  EXPECT_SENTENCE(refusal(npy_bytes({{2, 30}, rows}), "x.npy"));
  rows[24] = 0.0;
  rows[29] = std::nan("");
  EXPECT_SENTENCE(refusal(npy_bytes({{2, 30}, rows}), "x.npy"));
}

TEST(RobotMotionBadInput, ZeroQuaternionsAreRefused) {
  EXPECT_SENTENCE(refusal(npy_bytes({{2, 30}, std::vector<double>(60)}), "x.npy"));
}

TEST(RobotMotionBadInput, AnotherNumberOfJointsIsRefused) {
  const Eigen::MatrixXd rows = parse_csv_table(file_of("unitree"), "x.csv").values;
  EXPECT_SENTENCE(refusal(csv_text({}, rows.topRows(35)), "x.csv"));
  EXPECT_SENTENCE(refusal(csv_text({}, rows.topRows(7)), "x.csv"));
  EXPECT_SENTENCE(refusal(csv_text({}, rows.leftCols(1)), "x.csv"));
}

// Tables with columns and no line: under the sanitizers, also that no row of them is pointed at.
TEST(RobotMotionBadInput, ArchivesWithoutFramesAreRefused) {
  for (const auto& [name, bytes] : samples()) {
    if (name != "x.npz") continue;
    Npz npz = Npz::parse(bytes, name);
    for (const std::string& key : npz.keys()) {
      NpyArray array = npz.array(key);
      if (array.shape.size() < 2) continue;
      array.shape.front() = 0;
      std::visit([](auto& values) { values.clear(); }, array.values);
      npz.set(key, array);
    }
    EXPECT_SENTENCE(refusal(npz.bytes(), name));
  }
}

TEST(RobotMotionBadInput, JointsOfAnotherRobotAreRefused) {
  const RobotModel t1 = load_robot(card_path("t1"));
  const std::string bytes = robot_motion_files(known_motion(t1), t1, robot_motion_format("hhtools")).at("");
  EXPECT_SENTENCE(refusal(bytes, "x.csv"));
  std::string twice = file_of("hhtools");
  const std::size_t at = twice.find("dof_left_hip_roll_joint");
  twice.replace(at, 23, "dof_left_hip_pitch");
  EXPECT_SENTENCE(refusal(twice, "x.csv"));
}

TEST(RobotMotionBadInput, BrokenTablesAreRefused) {
  for (const char* text : {"1,2,3\n1,2\n", "a,a\n1,2\n", "a,b\n", "# only words\n", "1,,3\n"})
    EXPECT_SENTENCE(refusal(text, "x.csv"));
  EXPECT_SENTENCE(refusal(std::string(5000, ','), "x.csv"));
  std::string rate = file_of("hhtools");
  rate.replace(0, rate.find('\n'), "# fps: fast");
  EXPECT_SENTENCE(refusal(rate, "x.csv"));
  std::string still = file_of("hhtools");
  still.erase(0, still.find('\n') + 1);
  const CsvTable table = parse_csv_table(still, "x.csv");
  Eigen::MatrixXd rows = table.values;
  rows.row(0).setZero();
  EXPECT_SENTENCE(refusal(csv_text(table.columns, rows), "x.csv"));
}

TEST(RobotMotionBadInput, BrokenTrajectoriesOfLocoMujocoAreRefused) {
  const Npz good = Npz::parse(test::locomujoco_stand_in(known_motion(g1()), g1()), "x");
  const auto with = [&](const std::string& key, NpyArray array) {
    Npz npz = good;
    npz.set(key, std::move(array));
    return refusal(npz.bytes(), "x.npz", {.motion = "0"});
  };
  EXPECT_SENTENCE(with("split_points", {{2}, std::vector<std::int64_t>{0, 1 << 30}}));
  EXPECT_SENTENCE(with("split_points", {{3}, std::vector<std::int64_t>{0, 5, 2}}));
  EXPECT_SENTENCE(with("split_points", {{2}, std::vector<std::int64_t>{-4, 5}}));
  EXPECT_SENTENCE(with("jnt_type", {{30}, std::vector<std::int64_t>(30, 3)}));
  EXPECT_SENTENCE(with("joint_names", {{1}, std::vector<std::string>{"root"}}));
  EXPECT_SENTENCE(with("joint_names", {{0}, std::vector<std::string>{}}));
}

// LocoMuJoCo keeps `None` in arrays of Python objects, which are never read.
TEST(RobotMotionBadInput, ArraysOfPythonObjectsAreLeftOut) {
  const std::string object = std::string("\x93NUMPY\x01\x00\x76\x00", 10) +
                             fmt::format("{:<117}\n", "{'descr': '|O', 'fortran_order': False, 'shape': (), }") +
                             "\x80\x04N.";
  const std::string good = test::locomujoco_stand_in(known_motion(g1()), g1());
  const Npz npz = Npz::parse(good, "x");
  std::vector<ZipEntry> entries = {{"metadata.npy", object}};
  for (const std::string& key : npz.keys()) entries.push_back({key + ".npy", npy_bytes(npz.array(key))});
  const std::string bytes = zip_bytes(entries);
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)Npz::parse(bytes, "x"); }));
  EXPECT_EQ(read_robot_motion(motion_source(bytes, "x.npz"), g1(), {.motion = "0"}).format, "locomujoco");
}

TEST(RobotMotionBadInput, PicklesThatNameAClassAreRefused) {
  test::PickleWriter gmr;
  gmr.raw("}(").text("root_pos").raw("cos\nsystem\n").text("id").raw("\x85Ru.");
  EXPECT_SENTENCE(refusal(gmr.str(), "x.pkl"));
}

// A name in a file is a name: it never becomes a path.
TEST(RobotMotionBadInput, NamesThatClimbOutOfAFolderStayNames) {
  const test::ScratchFolder folder;
  const RobotMotion motion = known_motion(g1());
  const std::string climbing = "../../../climbed";
  write_robot_motion(motion, g1(), robot_motion_format("phc"), folder / "in/x.pkl", {.name = climbing});
  EXPECT_LT(test::distance(read_robot_motion(folder / "in/x.pkl", g1(), {.motion = climbing}).motion, motion), 1e-6);
  write_robot_motion(motion, g1(), robot_motion_format("sonic"), folder / "in/sonic", {.name = climbing});
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder / "."))
    EXPECT_EQ(entry.path().string().find("climbed"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "../../../climbed"));
}

TEST(RobotMotionBadInput, LinksInAFolderAreRefused) {
  const test::ScratchFolder folder;
  write_robot_motion(known_motion(g1()), g1(), robot_motion_format("sonic"), folder / "walk");
  std::filesystem::rename(folder / "walk/body_pos.csv", folder / "elsewhere.csv");
  std::filesystem::create_symlink(folder / "elsewhere.csv", folder / "walk/body_pos.csv");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)read_robot_motion(folder / "walk", g1()); }));
}

TEST(RobotMotionBadInput, BrokenFoldersAreRefused) {
  const MotionFiles good = robot_motion_files(known_motion(g1()), g1(), robot_motion_format("sonic"));
  const auto with = [&](const std::string& name, const std::string& content) {
    MotionFiles files = good;
    files[name] = content;
    return thrown_message<InputError>([&] { (void)read_robot_motion(test::source_of(files, "walk"), g1()); });
  };
  EXPECT_SENTENCE(with("metadata.txt", "none"));
  EXPECT_SENTENCE(with("metadata.txt", "Body part indexes: [0 x]"));
  EXPECT_SENTENCE(with("metadata.txt", "Body part indexes: [0 -1]"));
  EXPECT_SENTENCE(with("metadata.txt", "Body part indexes: [1 2]"));
  EXPECT_SENTENCE(with("metadata.txt", "Body part indexes: [0]"));
  EXPECT_SENTENCE(with("body_quat.csv", "body_0_w\nword\n"));
  const std::string& places = good.at("body_pos.csv");
  EXPECT_SENTENCE(with("body_pos.csv", places.substr(0, places.rfind('\n', places.size() - 2) + 1)));
  MotionFiles missing = good;
  missing.erase("body_quat.csv");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)read_robot_motion(test::source_of(missing, "walk"), g1()); }));
  const test::ScratchFolder folder;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)read_robot_motion(folder / ".", g1()); }));
}

TEST(RobotMotionBadInput, OneOfSeveralMotionsOfALibraryMustBeNamed) {
  PickleOutput out;
  out.begin_dict().key("walk").begin_dict().key("root_trans_offset").array({2, 3}, std::vector<double>(6)).end_dict();
  out.key("run").begin_dict().end_dict();
  const std::string bytes = out.end_dict().finish();
  EXPECT_SENTENCE(refusal(bytes, "x.pkl"));
  EXPECT_SENTENCE(refusal(bytes, "x.pkl", {.motion = "jump"}));
}

}  // namespace
}  // namespace duet
