#include "duet/robots/urdf.h"

#include <Eigen/Geometry>
#include <numbers>

#include "duet/robots/kinematics.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::kSmallCard;
using test::kSmallUrdf;
using test::replaced;

std::string urdf_error(const std::string& urdf) {
  return test::thrown_message<InputError>([&] { parse_urdf(urdf, "x.urdf"); });
}

TEST(Urdf, ReadsLinksAndJointsParentsFirst) {
  const UrdfModel model = parse_urdf(kSmallUrdf, "x.urdf");
  ASSERT_EQ(model.links.size(), 4u);
  EXPECT_EQ(model.links[0].name, "base");
  for (size_t i = 0; i < model.joints.size(); ++i) {
    EXPECT_EQ(model.joints[i].child, static_cast<int>(i) + 1);
    EXPECT_LT(model.joints[i].parent, model.joints[i].child);
  }
  const UrdfJoint& elbow = model.joints[2];
  EXPECT_EQ(elbow.name, "elbow");
  EXPECT_EQ(elbow.type, UrdfJointType::kContinuous);
  EXPECT_EQ(elbow.lower, -2.0 * std::numbers::pi);
  EXPECT_EQ(elbow.upper, 2.0 * std::numbers::pi);
  EXPECT_LT((elbow.axis - Eigen::Vector3d(1, 1, 0).normalized()).norm(), 1e-15);
}

TEST(Urdf, RollPitchYawTurnAboutFixedAxes) {
  const UrdfJoint joint = parse_urdf(kSmallUrdf, "x.urdf").joints[0];
  const Eigen::Matrix3d expected =
      (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  EXPECT_LT((joint.X_PC.R.toRotationMatrix() - expected).norm(), 1e-15);
}

TEST(Urdf, InertiaIsTurnedIntoTheLinksAxes) {
  const std::string turned =
      replaced(kSmallUrdf, "<origin xyz=\"0 0 0.1\"/>", "<origin xyz=\"0 0 0.1\" rpy=\"0 0 1.5707963267948966\"/>");
  const UrdfModel model = parse_urdf(turned, "x.urdf");
  EXPECT_LT((model.links[0].inertia.diagonal() - Eigen::Vector3d(0.03, 0.02, 0.025)).norm(), 1e-15);
}

// Merging: mass, first moment and inertia about a common point of the merged link are the sums of its parts'.
TEST(Urdf, MergedPartsKeepMassMomentAndInertia) {
  const RobotModel model = test::load_small();
  ASSERT_EQ(model.links.size(), 3u);
  const RobotLink& merged = model.links[1];
  EXPECT_NEAR(merged.mass, 4.0, 1e-15);
  // The brick is turned by 90 degrees about z: its x axis is the link's y axis.
  const Eigen::Vector3d brick_com = Eigen::Vector3d(0.05, 0, -0.2) + Eigen::Vector3d(0, 0.02, 0);
  EXPECT_LT((merged.com - (1.0 * Eigen::Vector3d(0, 0, -0.1) + 3.0 * brick_com) / 4.0).norm(), 1e-15);
  const auto about_origin = [](double m, const Eigen::Vector3d& c, const Eigen::Matrix3d& I) -> Eigen::Matrix3d {
    return I + m * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  };
  Eigen::Matrix3d upper = Eigen::Vector3d(0.01, 0.01, 0.002).asDiagonal();
  Eigen::Matrix3d brick;
  brick << 0.004, -0.0001, 0, -0.0001, 0.003, 0, 0, 0, 0.005;
  const Eigen::Matrix3d sum = about_origin(1.0, {0, 0, -0.1}, upper) + about_origin(3.0, brick_com, brick);
  EXPECT_LT((about_origin(merged.mass, merged.com, merged.inertia) - sum).norm(), 1e-15);
  EXPECT_EQ(model.frames[model.frame_index("brick")].link, 1);
  EXPECT_LT((model.frames[model.frame_index("brick")].X_LF.p - Eigen::Vector3d(0.05, 0, -0.2)).norm(), 1e-15);
}

TEST(Urdf, LockedJointIsMergedAtItsAngle) {
  const std::string card = replaced(kSmallCard, "  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n",
                                    "locked:\n  - {name: elbow, position: 0.6}\n");
  const RobotModel locked = test::load_small(card), free = test::load_small();
  ASSERT_EQ(locked.dof(), 1);
  EXPECT_NEAR(locked.total_mass(), free.total_mass(), 1e-15);
  Kinematics a(locked), b(free);
  a.update({}, Eigen::VectorXd::Constant(1, 0.3));
  b.update({}, Eigen::Vector2d(0.3, 0.6));
  EXPECT_LT((a.center_of_mass() - b.center_of_mass()).norm(), 1e-15);
  EXPECT_LT((a.frame_position(locked.frame_index("tip")) - b.frame_position(free.frame_index("tip"))).norm(), 1e-15);
}

TEST(Urdf, MasslessRootWithAFloatingJointIsTheWorld) {
  const std::string world =
      replaced(kSmallUrdf, "<link name=\"base\">",
               "<link name=\"world\"/><joint name=\"float\" type=\"floating\"><parent link=\"world\"/><child "
               "link=\"base\"/></joint><link name=\"base\">");
  const RobotModel model = test::load_small(kSmallCard, world);
  EXPECT_EQ(model.links[0].name, "base");
  EXPECT_EQ(model.dof(), 2);
}

TEST(Urdf, LoadsTheMakersFilesWithCardsOfTheirOwn) {
  for (const char* name : {"g1_12dof", "g1_29dof_rev_1_0", "g1_29dof_with_hand_rev_1_0"}) {
    const std::string path = test::shared_file(fmt::format("g1/{}.urdf", name));
    if (path.empty()) GTEST_SKIP() << "not run: g1 absent";
    const UrdfModel urdf = parse_urdf(read_file(path), path);
    std::string card = "name: other\nurdf: none.urdf\nbase: pelvis\njoints:\n", locked = "locked:\n";
    int movable = 0, fingers = 0;
    for (const UrdfJoint& joint : urdf.joints) {
      if (joint.type == UrdfJointType::kFixed) continue;
      if (joint.name.find("_hand_") != std::string::npos) {
        locked += fmt::format("  - {{name: {}, position: 0}}\n", joint.name);
        ++fingers;
        continue;
      }
      card += fmt::format("  - {{name: {}, armature: 0.01, kp: 100, kd: 2}}\n", joint.name);
      ++movable;
    }
    if (fingers > 0) card += locked;
    const test::ScratchFolder folder;
    write_file(folder / "card.yaml", card);
    const RobotModel model = load_robot(folder / "card.yaml", path);
    EXPECT_EQ(model.dof(), movable);
    EXPECT_EQ(movable, std::string(name) == "g1_12dof" ? 12 : 29);
    double mass = 0.0;
    for (const UrdfLink& link : urdf.links) mass += link.mass;
    EXPECT_NEAR(model.total_mass(), mass, 1e-12);
    EXPECT_EQ(model.standing_height, 0.0);
  }
}

// Shapes, materials and transmissions are not looked at, so neither are their faults.
TEST(Urdf, GeometryMayBeAnything) {
  const std::string odd =
      replaced(kSmallUrdf, "<visual><geometry><mesh filename=\"package://nowhere/upper.STL\"/></geometry></visual>",
               "<visual><geometry><torus radius=\"x\"/></geometry><material name=\"unheard of\"/></visual>"
               "<collision><geometry><capsule radius=\"0.1\" length=\"nan\"/></geometry></collision><collision/>");
  EXPECT_EQ(parse_urdf(odd, "x.urdf").links.size(), 4u);
  EXPECT_EQ(parse_urdf(replaced(kSmallUrdf, "</robot>", "<material/><transmission/></robot>"), "x.urdf").links.size(),
            4u);
}

TEST(UrdfErrors, NotXml) {
  for (const char* text : {"", " \n ", "joints: 3", "<sdf/>"}) EXPECT_SENTENCE(urdf_error(text));
  EXPECT_SENTENCE(urdf_error(kSmallUrdf.substr(0, kSmallUrdf.size() / 2)));
}

TEST(UrdfErrors, Tree) {
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "</robot>", "<link name=\"loose\"/></robot>")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "</robot>", "<link name=\"brick\"/></robot>")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "name=\"elbow\"", "name=\"weld\"")));
  const std::string back =
      "<joint name=\"back\" type=\"fixed\"><parent link=\"lower\"/><child link=\"base\"/></joint></robot>";
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "</robot>", back)));
  const std::string island =
      "<link name=\"a\"/><link name=\"b\"/><joint name=\"ab\" type=\"fixed\"><parent link=\"a\"/><child "
      "link=\"b\"/></joint><joint name=\"ba\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint></robot>";
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "</robot>", island)));
  const std::string second =
      "<joint name=\"second\" type=\"fixed\"><parent link=\"base\"/><child link=\"lower\"/></joint></robot>";
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "</robot>", second)));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<child link=\"lower\"/>", "<child link=\"lowr\"/>")));
  EXPECT_SENTENCE(urdf_error("<robot name=\"empty\"/>"));
}

TEST(UrdfErrors, AChainWithoutEndIsRefused) {
  std::string chain = "<robot name=\"r\"><link name=\"l0\"/>";
  for (int i = 0; i < 50'000; ++i)
    chain += fmt::format(
        "<link name=\"l{1}\"/><joint name=\"j{0}\" type=\"fixed\"><parent link=\"l{0}\"/><child "
        "link=\"l{1}\"/></joint>",
        i, i + 1);
  EXPECT_SENTENCE(urdf_error(chain + "</robot>"));
}

TEST(UrdfErrors, Joints) {
  EXPECT_SENTENCE(
      urdf_error(replaced(kSmallUrdf, "<limit lower=\"-1\" upper=\"2\" effort=\"10\" velocity=\"5\"/>", "")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, " effort=\"10\"", "")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "lower=\"-1\"", "lower=\"nan\"")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "upper=\"2\"", "upper=\"1e999\"")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "type=\"continuous\"", "type=\"hinge\"")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 1 zero\"/>")));
}

// Joints that mimic one that moves are refused where the card does not lock them; those that mimic a locked one are
// locked with it.
TEST(UrdfErrors, MimicsThatTheCardDoesNotLock) {
  const auto with_fingers = [](const std::string& locked) {
    const test::ScratchFolder folder;
    const std::string finger =
        "<link name=\"{0}\"><inertial><mass value=\"0.1\"/><inertia ixx=\"0.01\" iyy=\"0.01\" izz=\"0.01\" ixy=\"0\" "
        "ixz=\"0\" "
        "iyz=\"0\"/></inertial></link><joint name=\"j{0}\" type=\"revolute\"><parent link=\"base\"/><child "
        "link=\"{0}\"/>"
        "<origin xyz=\"0 0 1\"/><axis xyz=\"1 0 0\"/><limit lower=\"-3\" upper=\"3\" effort=\"1\" "
        "velocity=\"1\"/>{1}</joint>";
    std::string urdf = kSmallUrdf;
    urdf.insert(urdf.find("</robot>"),
                fmt::format(fmt::runtime(finger), "a", "") +
                    fmt::format(fmt::runtime(finger), "b", "<mimic joint=\"ja\" multiplier=\"2\" offset=\"0.5\"/>"));
    write_file(folder / "small.urdf", urdf);
    write_file(folder / "small.yaml", kSmallCard + locked);
    return load_robot(folder / "small.yaml", folder / "small.urdf");
  };
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { with_fingers("locked: [{name: jc, position: 0}]\n"); }));
  const auto angle = [](const RobotModel& robot) {
    return Eigen::AngleAxisd(robot.frames[robot.frame_index("b")].X_LF.R).angle();
  };
  EXPECT_NEAR(angle(with_fingers("locked: [{name: ja, position: 0.25}]\n")), 1.0, 1e-12);
  EXPECT_NEAR(angle(with_fingers("locked: [{name: ja, position: 0.25}, {name: jb, position: 0.1}]\n")), 0.1, 1e-12);
}

TEST(UrdfErrors, WhatXacroIsStillToBeRunOnIsRefused) {
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<robot name=\"small\">",
                                      "<robot name=\"small\">\n<xacro:property name=\"w\" value=\"1\"/>")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<mass value=\"2\"/>", "<mass value=\"${m}\"/>")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<inertial>", "<xacro:if value=\"1\"/><inertial>")));
}

TEST(UrdfErrors, EncodingsOtherThanUtf8AreTold) {
  const auto wide = [](int bytes, bool big, bool mark) {
    std::string text;
    const auto add = [&](unsigned code) {
      for (int i = 0; i < bytes; ++i) text += static_cast<char>(code >> 8 * (big ? bytes - 1 - i : i) & 0xff);
    };
    if (mark) add(0xfeff);
    for (const char c : kSmallUrdf) add(static_cast<unsigned char>(c));
    return text;
  };
  for (const int bytes : {2, 4})
    for (const bool big : {false, true})
      for (const bool mark : {false, true}) EXPECT_SENTENCE(urdf_error(wide(bytes, big, mark)));
}

TEST(UrdfErrors, Inertia) {
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<mass value=\"2\"/>", "<mass value=\"-2\"/>")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<mass value=\"2\"/>", "<mass value=\"nan\"/>")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "<mass value=\"2\"/>", "<mass/>")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "ixx=\"0.02\"", "ixx=\"-0.02\"")));
  EXPECT_SENTENCE(urdf_error(replaced(kSmallUrdf, "ixx=\"0.02\"", "")));
}

TEST(UrdfErrors, PrintNothingToTheConsole) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  urdf_error("<robot name=\"empty\"/>");
  urdf_error(replaced(kSmallUrdf, "<mass value=\"2\"/>", "<mass/>"));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
}

const std::string kTooDeep = "x.urdf:1: expected elements of at most 100 levels, found one that is deeper";

std::string refusal(const std::string& text) {
  return test::thrown_message<InputError>([&] { check_xml_nesting(text, "x.urdf"); });
}

std::string repeated(const std::string& text, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += text;
  return result;
}

TEST(XmlNesting, AcceptsWhatIsAsDeepAsTheLimit) {
  check_xml_nesting(repeated("<a>", 100) + repeated("</a>", 100), "x.urdf");
  check_xml_nesting("<r>" + repeated("<a><b c='>'/><!-- <x> --></a>", 10'000) + "</r>", "x.urdf");
  check_xml_nesting(test::kSmallUrdf, "x.urdf");
}

TEST(XmlNesting, RefusesWhatNestsDeeper) {
  for (const int depth : {101, 200'000}) {
    EXPECT_EQ(refusal(repeated("<a>", depth)), kTooDeep);
    EXPECT_EQ(refusal(repeated("<a b=\"c\" >", depth)), kTooDeep);
    EXPECT_EQ(refusal("<r>" + repeated("<a>", depth) + repeated("</a>", depth) + "</r>"), kTooDeep);
  }
}

// Text that looks like an end and is none must not hide the depth.
TEST(XmlNesting, IsNotFooledByEndsInCommentsValuesAndText) {
  for (const char* level :
       {"<a><!-- </a> -->", "<a><![CDATA[</a>]]>", "<a b='/>'>", "<a b=\"</\">", "<a b='/' >", "<a b=\"'/>'\">",
        "<a><?xml x'y version='></a>'?>", "<a><?xml </a> ?>", "<a><!DOCTYPE </a> >", "<a><?b '/>' ?>"})
    EXPECT_NE(refusal(repeated(level, 101)), "(nothing was thrown)") << level;
  EXPECT_EQ(refusal(repeated("<a><!-- </a> -->", 101)), kTooDeep);
  EXPECT_EQ(refusal(repeated("<a b='/>'>", 101)), kTooDeep);
}

TEST(XmlNesting, RefusesMarkupWithoutItsEnd) {
  const std::string expected = "x.urdf:2: expected well-formed XML, found ";
  EXPECT_EQ(refusal("<a>\n<b"), expected + "a tag without its '>'");
  EXPECT_EQ(refusal("<a>\n<b c='>'"), expected + "a tag without its '>'");
  EXPECT_EQ(refusal("<a>\n<b c='<d>'/>"), expected + "a tag without its '>'");
  EXPECT_EQ(refusal("<a>\n<!-- b"), expected + "no end '-->'");
  EXPECT_EQ(refusal("<a>\n<![CDATA[ b"), expected + "no end ']]>'");
  EXPECT_SENTENCE(refusal("<a>\n<?b '>' ?>"));
  EXPECT_EQ(refusal("<a>\n<"), expected + "a tag without its '>'");
}

TEST(XmlNesting, ADeepUrdfIsRefusedInOneSentence) {
  EXPECT_EQ(test::thrown_message<InputError>([] { parse_urdf(repeated("<a>", 200'000), "x.urdf"); }), kTooDeep);
}

}  // namespace
}  // namespace duet
