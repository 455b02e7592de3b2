// Files of robot motions with one fact wrong each. None is imported silently: it is refused, or read as the motion that
// it is, or a line that begins with "doubt" says what speaks against it. Facts that no file can tell are listed last.
#include <gmock/gmock.h>

#include <cctype>
#include <functional>
#include <numbers>
#include <ostream>

#include "duet/core/require.h"
#include "duet/formats/motion_layout.h"
#include "duet/formats/pickle_output.h"
#include "duet/formats/robot_motion_format.h"
#include "tests/formats/known_motion.h"
#include "tests/formats/motion_files.h"

namespace duet {
namespace {

using test::distance;
using test::robot;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr double kRightMotion = 1e-5;  // nine digits of text, in degrees and centimetres too
constexpr double kRate = 50.0;
constexpr double kDegree = std::numbers::pi / 180.0;

struct WrongFact {
  std::string fact;   // what is wrong; of the test's name
  std::string robot;  // "g1", "t1"
  std::string name;   // of the file
  std::string bytes;
  std::string told;  // words of the refusal or of the evidence that name the fact
  RobotMotionOptions options = {};

  friend void PrintTo(const WrongFact& wrong, std::ostream* out) { *out << wrong.robot << " " << wrong.fact; }
};

// Squats on flat soles and waves both arms, each in its own way: every fact tells.
RobotMotion squatting_motion(const RobotModel& robot) {
  RobotMotion motion = test::known_motion(robot, 60, kRate);
  Kinematics kinematics(robot);
  const auto has_part = [](std::string name, std::string_view part) {
    for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return name.find(part) != std::string::npos;
  };
  for (int t = 0; t < motion.frames(); ++t) {
    const double depth = 0.15 * (1.0 - std::cos(0.2 * t));
    for (int j = 0; j < robot.dof(); ++j) {
      const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
      const bool pitch = has_part(joint.name, "hip_pitch") || has_part(joint.name, "ankle_pitch");
      const bool knee = has_part(joint.name, "knee");
      const bool arm = has_part(joint.name, "shoulder") || has_part(joint.name, "elbow");
      const double bend = pitch ? -depth : knee ? 2.0 * depth : arm ? 0.35 * std::sin(0.25 * t + 0.7 * j) : 0.0;
      motion.q(j, t) = std::clamp(robot.neutral[j] + bend, joint.lower, joint.upper);
    }
    Pose& X_WB = motion.root[static_cast<std::size_t>(t)];
    X_WB = {.R = yaw_rotation(0.4 + 0.01 * t), .p = {0.05 + 0.002 * t, 0.02, 0.0}};
    kinematics.update(X_WB, motion.q.col(t));
    double lowest = 1e9;
    for (const int shape : robot.feet)
      lowest =
          std::min(lowest, kinematics.shape_position(shape).z() - robot.shapes[static_cast<std::size_t>(shape)].radius);
    X_WB.p.z() = -lowest;
  }
  return motion;
}

std::string written(const std::string& name, const std::string& format) {
  return robot_motion_files(squatting_motion(robot(name)), robot(name), robot_motion_format(format), {.rate_hz = kRate})
      .at("");
}

// The rows of a table of Unitree's: x, y, z, quaternion xyzw, joints depth-first.
Eigen::MatrixXd rows_of_unitree(const std::string& name) {
  return parse_csv_table(written(name, "unitree"), "x.csv").values;
}

std::vector<int> counted(int first, int count) {
  std::vector<int> places;
  for (int i = 0; i < count; ++i) places.push_back(first + i);
  return places;
}

// The root's seven rows as they are, then the joints in another order.
std::vector<int> with_joints(const std::vector<int>& joints) {
  std::vector<int> places = counted(0, 7);
  for (const int j : joints) places.push_back(7 + j);
  return places;
}

using Edit = std::function<void(Eigen::MatrixXd&)>;

std::vector<WrongFact> wrong_roots(const std::string& name) {
  std::vector<WrongFact> cases;
  const auto add = [&](const std::string& fact, const std::string& told, const Edit& edit) {
    Eigen::MatrixXd rows = rows_of_unitree(name);
    edit(rows);
    cases.push_back({fact, name, "x_50hz.csv", csv_text({}, rows), told});
  };
  const int n = robot(name).dof();
  add("QuaternionScalarFirst", "root rotation: wxyz (detected)", [](Eigen::MatrixXd& r) {
    r.middleRows(3, 4) = rows_of(r, {6, 3, 4, 5});
  });
  add("QuaternionNegated", "root rotation: xyzw", [](Eigen::MatrixXd& r) { r.middleRows(3, 4) *= -1.0; });
  add("QuaternionBeforePosition", "expected a unit quaternion", [](Eigen::MatrixXd& r) {
    r.topRows(7) = rows_of(r, {3, 4, 5, 6, 0, 1, 2});
  });
  add("JointsBeforeRoot", "expected a unit quaternion", [n](Eigen::MatrixXd& r) {
    std::vector<int> places = counted(7, n);
    for (const int i : counted(0, 7)) places.push_back(i);
    r = rows_of(r, places);
  });
  add("Centimetres", "length: 0.01 m a unit (detected)", [](Eigen::MatrixXd& r) { r.topRows(3) *= 100.0; });
  add("Millimetres", "length: 0.001 m a unit (detected)", [](Eigen::MatrixXd& r) { r.topRows(3) *= 1000.0; });
  add("YUp", "expected z up", [](Eigen::MatrixXd& r) { r.row(1).swap(r.row(2)); });
  add("XUp", "expected z up", [](Eigen::MatrixXd& r) { r.row(0).swap(r.row(2)); });
  add("ZDown", "doubt: within the limits", [](Eigen::MatrixXd& r) { r.row(2) *= -1.0; });
  add("HeightAboveStanding", "doubt: within the limits", [](Eigen::MatrixXd& r) { r.row(2).array() -= r(2, 0); });
  return cases;
}

std::vector<WrongFact> wrong_joints(const std::string& name) {
  std::vector<WrongFact> cases;
  const auto add = [&](const std::string& fact, const std::string& told, const Edit& edit,
                       const std::string& file = "x_50hz.csv") {
    Eigen::MatrixXd rows = rows_of_unitree(name);
    edit(rows);
    cases.push_back({fact, name, file, csv_text({}, rows), told});
  };
  const int n = robot(name).dof();
  add("BreadthFirst", "joints: breadth-first, detected",
      [&](Eigen::MatrixXd& r) { r = rows_of(r, with_joints(joints_in_order(robot(name), TreeOrder::kBreadthFirst))); });
  add("JointsReversed", "within the limits", [n](Eigen::MatrixXd& r) {
    std::vector<int> places = counted(0, n);
    std::reverse(places.begin(), places.end());
    r = rows_of(r, with_joints(places));
  });
  add("JointsShiftedByOne", "within the limits", [n](Eigen::MatrixXd& r) {
    std::vector<int> places = counted(1, n);
    places.back() = 0;
    r = rows_of(r, with_joints(places));
  });
  add("ArmsBeforeLegs", "within the limits", [n](Eigen::MatrixXd& r) {
    std::vector<int> places = counted(n / 2, n - n / 2);
    for (const int i : counted(0, n / 2)) places.push_back(i);
    r = rows_of(r, with_joints(places));
  });
  add("SignsOfJoints", "within the limits", [n](Eigen::MatrixXd& r) { r.bottomRows(n) *= -1.0; });
  add("Degrees", "angles: deg (detected)", [n](Eigen::MatrixXd& r) { r.bottomRows(n) /= kDegree; });
  add("DegreesTurnedToRadiansTwice", "doubt: no joint is bent by more than",
      [n](Eigen::MatrixXd& r) { r.bottomRows(n) *= kDegree; });
  add("OneJointMissing", "joints for robot", [](Eigen::MatrixXd& r) { r = r.topRows(r.rows() - 1).eval(); });
  add(
      "RateTenTimesTooHigh", "doubt: at 500 Hz a joint is quicker", [](Eigen::MatrixXd&) {}, "x_500hz.csv");
  return cases;
}

// Names that stand over other columns than their own, in a table that is right.
std::vector<WrongFact> wrong_names() {
  std::vector<WrongFact> cases;
  const Eigen::MatrixXd rows = rows_of_unitree("g1");
  const auto add = [&](const std::string& fact, const std::string& told, const std::vector<int>& order) {
    std::vector<std::string> names = {"root_x", "root_y", "root_z", "qx", "qy", "qz", "qw"};
    for (const std::string& joint : joint_names(robot("g1"), order)) names.push_back(joint);
    cases.push_back({fact, "g1", "x_50hz.csv", csv_text(names, rows), told});
  };
  std::vector<int> reversed = counted(0, 29), shifted = counted(1, 29);
  std::reverse(reversed.begin(), reversed.end());
  shifted.back() = 0;
  add("NamesInBreadthFirstOrder", "doubt: within the limits", joints_in_order(robot("g1"), TreeOrder::kBreadthFirst));
  add("NamesReversed", "doubt: within the limits", reversed);
  add("NamesShiftedByOne", "doubt: within the limits", shifted);
  return cases;
}

std::string exchanged_sides(std::string name) {
  const std::size_t left = name.find("left"), right = name.find("right");
  if (left != std::string::npos) return name.replace(left, 4, "right");
  return right == std::string::npos ? name : name.replace(right, 5, "left");
}

std::vector<WrongFact> wrong_archives() {
  std::vector<WrongFact> cases;
  const auto add = [&](const std::string& fact, const std::string& told, const std::function<void(Npz&)>& edit) {
    Npz npz = Npz::parse(written("g1", "beyondmimic"), "x.npz");
    edit(npz);
    cases.push_back({fact, "g1", "x.npz", npz.bytes(), told});
  };
  const auto scaled = [](Npz& npz, const std::string& key, double factor) {
    NpyArray array = npz.array(key);
    for (double& value : std::get<std::vector<double>>(array.values)) value *= factor;
    npz.set(key, array);
  };
  const std::vector<int> depth_first = joints_in_order(robot("g1"), TreeOrder::kDepthFirst);
  add("BodiesNamedByTheOtherSide", "doubt: the file's bodies are elsewhere", [](Npz& npz) {
    std::vector<std::string> names = npz.strings("body_names", {-1});
    for (std::string& name : names) name = exchanged_sides(name);
    npz.set("body_names", names);
  });
  add("JointsNamedByTheOtherSide", "doubt: the file's bodies are elsewhere", [](Npz& npz) {
    std::vector<std::string> names = npz.strings("joint_names", {-1});
    for (std::string& name : names) name = exchanged_sides(name);
    npz.set("joint_names", names);
  });
  add("JointsNamedDepthFirst",
      "doubt: ", [&](Npz& npz) { npz.set("joint_names", joint_names(robot("g1"), depth_first)); });
  add("BodiesInCentimetres", "length: 0.01 m a unit (detected)", [&](Npz& npz) { scaled(npz, "body_pos_w", 100.0); });
  add("NamedJointsInDegrees", "angles: deg (detected)", [&](Npz& npz) { scaled(npz, "joint_pos", 1.0 / kDegree); });
  add("RateOfTheArchive", "doubt: at 1000 Hz a joint is quicker", [](Npz& npz) { npz.set_number("fps", 1000.0); });
  return cases;
}

std::vector<WrongFact> wrong_units() {
  std::string tools = written("g1", "hhtools");
  tools.replace(tools.find(": 50"), 4, ": 25");
  CsvTable bones = parse_csv_table(written("g1", "bones"), "x.csv");
  bones.values.bottomRows(29) *= kDegree;
  CsvTable metres = parse_csv_table(written("g1", "bones"), "x.csv");
  metres.values.middleRows(1, 3) *= 0.01;
  return {{"RateAgainstTheTimes", "g1", "x.csv", tools, "doubt: 'sample_rate' of the file says 25 Hz"},
          {"RadiansForDegrees",
           "g1",
           "x.csv",
           csv_text(bones.columns, bones.values),
           "is the unit of the angles right",
           {.rate_hz = kRate}},
          {"MetresForCentimetres",
           "g1",
           "x.csv",
           csv_text(metres.columns, metres.values),
           "length: 1 m a unit (detected)",
           {.rate_hz = kRate}}};
}

std::vector<WrongFact> wrong_facts() {
  std::vector<WrongFact> all;
  for (const auto& part : {wrong_roots("g1"), wrong_roots("t1"), wrong_joints("g1"), wrong_joints("t1"), wrong_names(),
                           wrong_archives(), wrong_units()})
    all.insert(all.end(), part.begin(), part.end());
  return all;
}

// The report on a file: its evidence, or its refusal alone.
struct Told {
  std::vector<std::string> lines;
  bool refused = false, right = false;
};

Told told_of(const WrongFact& wrong) {
  Told told;
  try {
    const RobotMotionFile read =
        read_robot_motion(motion_source(wrong.bytes, wrong.name), robot(wrong.robot), wrong.options);
    told.lines = read.evidence;
    told.right =
        read.motion.rate_hz == kRate && distance(read.motion, squatting_motion(robot(wrong.robot))) < kRightMotion;
  } catch (const InputError& error) {
    told.lines = {error.what()};
    told.refused = true;
  }
  return told;
}

class OneWrongFact : public ::testing::TestWithParam<WrongFact> {};

TEST_P(OneWrongFact, IsNeverImportedSilently) {
  const Told told = told_of(GetParam());
  if (!told.refused && !told.right) {
    EXPECT_THAT(told.lines, Contains(StartsWith("doubt: ")));
  }
  EXPECT_THAT(told.lines, Contains(HasSubstr(GetParam().told)));
}

INSTANTIATE_TEST_SUITE_P(RobotMotions, OneWrongFact, ::testing::ValuesIn(wrong_facts()),
                         [](const auto& info) { return info.param.robot + info.param.fact; });

// The control: nothing speaks against the same motion with every fact right.
TEST(OneWrongFact, NothingIsDoubtedOfTheRightMotion) {
  for (const char* name : {"g1", "t1"})
    for (const char* format : {"unitree", "bones", "hhtools", "beyondmimic", "gmr", "phc"}) {
      const std::string file = std::string("x_50hz") + robot_motion_format(format).ending;
      const RobotMotionFile read =
          read_robot_motion(motion_source(written(name, format), file), robot(name), {.rate_hz = kRate});
      EXPECT_LT(distance(read.motion, squatting_motion(robot(name))), kRightMotion) << name << " " << format;
      EXPECT_THAT(read.evidence, Not(Contains(StartsWith("doubt")))) << name << " " << format;
    }
}

// Facts that a file without names and bodies cannot tell; docs/file-formats.md says so. A reader that learns to tell
// one of them moves it into the list above.
TEST(OneWrongFact, WhatNoFileCanTellIsKnown) {
  std::vector<WrongFact> silent;
  const auto add = [&](const std::string& reason, const Edit& edit, const std::string& file = "x_50hz.csv") {
    Eigen::MatrixXd rows = rows_of_unitree("g1");
    edit(rows);
    silent.push_back({reason, "g1", file, csv_text({}, rows), ""});
  };
  add("a robot with exchanged sides is as possible as the one that moved", [](Eigen::MatrixXd& r) {
    std::vector<int> places;
    for (const std::string& joint : robot("g1").joint_names())
      places.push_back(robot("g1").joint_index(exchanged_sides(joint)));
    r = rows_of(r, with_joints(places));
  });
  add(
      "whoever moves at half the speed moves as plausibly", [](Eigen::MatrixXd&) {}, "x_25hz.csv");
  add("the floor has no directions", [](Eigen::MatrixXd& r) { r.row(0).swap(r.row(1)); });
  add("an upright robot may turn either way", [](Eigen::MatrixXd& r) { r.row(5) *= -1.0; });
  for (const WrongFact& wrong : silent) {
    const Told told = told_of(wrong);
    EXPECT_FALSE(told.refused || told.right) << wrong.fact;
    EXPECT_THAT(told.lines, Not(Contains(StartsWith("doubt")))) << wrong.fact;
  }
}

}  // namespace
}  // namespace duet
