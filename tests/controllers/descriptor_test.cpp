#include "duet/controllers/descriptor.h"

#include <gmock/gmock.h>

#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/descriptor_controller.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kSmall = R"(name: small
about: two joints
licence: none
robot: g1
network: small.onnx
rate_hz: 50
joints:
  - {name: a, default: 0.1, kp: 10, kd: 1, action: 0.25}
  - {name: b, default: 0, kp: 20, kd: 2, effort: 5}
observation:
  first:
    - {channel: joint_position, joints: [b, a]}
    - {channel: base_angular_velocity, scale: [1, 2, 3], clip: 4}
  second:
    - {channel: previous_action}
inputs:
  - name: x
    parts:
      - {groups: [second, first], frames: 3, start: repeated}
      - {groups: [first]}
)";

std::string changed(const std::string& from, const std::string& to) {
  std::string text = kSmall;
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string message(const std::string& text) {
  return thrown_message<InputError>([&] { parse_descriptor(text, "x.yaml"); });
}

TEST(IoDescriptor, IsReadAsWritten) {
  const Descriptor d = parse_descriptor(kSmall, "x.yaml");
  EXPECT_EQ(d.actions(), 1);
  EXPECT_EQ(d.joints[1].effort, 5.0);
  EXPECT_FALSE(d.joints[1].action.has_value());
  EXPECT_EQ(d.observation.groups[0].channels[0].joints, (std::vector<int>{1, 0}));
  EXPECT_EQ(d.observation.groups[0].channels[1].clip, 4.0);
  EXPECT_TRUE(d.observation.inputs[0].parts[0].history.starts_full);
  EXPECT_EQ(d.input_size(d.observation.inputs[0]), 3 * 6 + 5);
  EXPECT_EQ(
      d.input_layout(d.observation.inputs[0]),
      "previous_action 0, joint_position 1..2, base_angular_velocity 3..5 (3 frames of 6); joint_position 18..19, "
      "base_angular_velocity 20..22");
  EXPECT_FALSE(d.walks);
  EXPECT_FALSE(d.command.has_value());
}

TEST(IoDescriptor, RefusesWhatItDoesNotKnowWithFileLineAndNearest) {
  EXPECT_SENTENCE(message(changed("licence: none", "license: none")));
  EXPECT_SENTENCE(message(changed("channel: joint_position", "channel: joint_positions")));
  EXPECT_SENTENCE(message(changed("joints: [b, a]", "joints: [b, c]")));
  EXPECT_SENTENCE(message(changed("groups: [first]", "groups: [frist]")));
}

TEST(IoDescriptor, RefusesKeysOfAnotherChannel) {
  for (const char* text : {"{channel: previous_action, phases: [0]}", "{channel: gait_sine}", "{channel: constant}",
                           "{channel: reference_frames, steps: [0]}"})
    EXPECT_SENTENCE(message(changed("{channel: previous_action}", text)));
}

TEST(IoDescriptor, RefusesValuesOutOfRange) {
  for (const char* rate : {"60", "0", "-50", "3", "75", "1000", ".inf"})
    EXPECT_SENTENCE(message(changed("rate_hz: 50", std::string("rate_hz: ") + rate)));
  EXPECT_SENTENCE(message(changed("kp: 10", "kp: -10")));
  EXPECT_SENTENCE(message(changed("kp: 10", "kp: .nan")));
  EXPECT_SENTENCE(message(changed("effort: 5", "effort: 0")));
  EXPECT_SENTENCE(message(changed("scale: [1, 2, 3]", "scale: [1, 2]")));
  EXPECT_SENTENCE(message(changed("frames: 3", "frames: 2.5")));
  EXPECT_SENTENCE(message(changed("start: repeated", "start: ones")));
  EXPECT_SENTENCE(message(changed("{name: b,", "{name: a,")));
  EXPECT_SENTENCE(message(changed(", action: 0.25", "")));
  EXPECT_SENTENCE(message(std::string(kSmall) + "command: {forward: {limits: [1, -1]}}\n"));
}

constexpr const char* kWalking =
    "command: {forward: {limits: [-1, 1]}, lateral: {limits: [-1, 1]}, yaw: {limits: [-1, 1]}, "
    "stands_below: {speed: 0.1, yaw_rate: 0.2}}\n";

TEST(IoDescriptor, TheRateIsAWholePartOrAMultipleOfFifty) {
  const std::tuple<const char*, int, int> rates[] = {
      {"50", 1, 1}, {"25", 2, 1}, {"12.5", 4, 1}, {"100", 1, 2}, {"200", 1, 4}};
  for (const auto& [rate, ticks, acts] : rates) {
    const Descriptor d = parse_descriptor(changed("rate_hz: 50", std::string("rate_hz: ") + rate), "x.yaml");
    EXPECT_EQ(d.ticks_per_act(), ticks) << rate;
    EXPECT_EQ(d.acts_per_tick(), acts) << rate;
    EXPECT_DOUBLE_EQ(d.period(), 1.0 / d.rate_hz);
  }
}

TEST(IoDescriptor, AnActionsRangeIsItsJointsOrElseThatOfAll) {
  const auto range = [](const std::string& one, const std::string& all) {
    return parse_descriptor(changed("action: 0.25}", "action: 0.25" + one + "}") + all, "x.yaml").action_ranges().at(0);
  };
  EXPECT_EQ(range("", "").upper, std::numeric_limits<double>::infinity());
  EXPECT_EQ(range("", "action: {clip: 3}\n").lower, -3.0);
  EXPECT_EQ(range(", clip: 2", "action: {clip: 3}\n").lower, -2.0);
  EXPECT_EQ(range(", clip: [-0.5, 2]", "action: {clip: 3}\n").lower, -0.5);
  EXPECT_EQ(range(", clip: [-0.5, 2]", "").upper, 2.0);
  for (const char* clip : {"0", "-1", "[2, 1]", "[1, 1]", "[1, 2, 3]", "wide"})
    EXPECT_SENTENCE(message(changed("action: 0.25}", std::string("action: 0.25, clip: ") + clip + "}")));
  EXPECT_SENTENCE(message(changed("{name: b,", "{name: b, clip: 1,")));
}

TEST(IoDescriptor, AClockMayBeSilentWhileItStands) {
  const auto gait = [](const std::string& keys) {
    return changed("{channel: previous_action}", "{channel: gait_cosine, frequency_hz: 1, " + keys + "}");
  };
  const Descriptor d =
      parse_descriptor(gait("phases: [0, 3], standing: zero, after_standing: pauses") + kWalking, "x.yaml");
  const GaitClock& clock = d.observation.groups[1].channels[0].gait;
  EXPECT_TRUE(clock.silent);
  EXPECT_EQ(clock.standing.size(), 2U);
  EXPECT_EQ(clock.after_standing, AfterStanding::kPauses);
  EXPECT_SENTENCE(message(gait("standing: zero")));
  EXPECT_SENTENCE(message(gait("standing: none") + kWalking));
  EXPECT_SENTENCE(message(gait("after_standing: pauses") + kWalking));
  EXPECT_SENTENCE(message(gait("standing: [1], after_standing: stops") + kWalking));
}

TEST(IoDescriptor, ACommandIsShownByItsAxesInTheirOrder) {
  const Descriptor d = parse_descriptor(
      changed("{channel: previous_action}", "{channel: command_velocity, axes: [2, 0], scale: [0.25, 2]}"), "x.yaml");
  EXPECT_EQ(d.observation.groups[1].channels[0].axes, (std::vector<int>{2, 0}));
  EXPECT_EQ(channels_size(d.observation.groups[1].channels, d.widths()), 2);
  EXPECT_SENTENCE(message(changed("{channel: previous_action}", "{channel: command_velocity, axes: [3]}")));
  EXPECT_SENTENCE(message(changed("{channel: previous_action}", "{channel: command_velocity, axes: []}")));
}

TEST(IoDescriptor, AChannelOfStandingNeedsToKnowWhichCommandIsOne) {
  const auto with = [](const std::string& channel) { return changed("{channel: previous_action}", channel); };
  EXPECT_SENTENCE(message(with("{channel: command_stand}")));
  const std::string gated = with("{channel: gait_sine, frequency_hz: 1, standing: [3]}");
  EXPECT_SENTENCE(message(gated));
  const Descriptor d = parse_descriptor(gated + kWalking, "x.yaml");
  EXPECT_EQ(d.observation.groups[1].channels[0].gait.standing, std::vector<double>{3.0});
  ASSERT_TRUE(d.command->stands_below.has_value());
  EXPECT_EQ(d.command->stands_below->speed, 0.1);
  EXPECT_EQ(d.command->stands_below->yaw_rate, 0.2);
}

TEST(IoDescriptor, RefusesBoundsOfStandingThatAreNone) {
  const auto with = [](const std::string& bounds) {
    const std::string direction = "{limits: [-1, 1]}";
    return message(std::string(kSmall) + "command: {forward: " + direction + ", lateral: " + direction +
                   ", yaw: " + direction + ", stands_below: " + bounds + "}\n");
  };
  for (const char* text : {"{speed: 0, yaw_rate: 1}", "{speed: 1}", "{speed: 1, yaw_rate: 1, height: 2}", "0.1"})
    EXPECT_SENTENCE(with(text));
}

TEST(IoDescriptor, RefusesAGaitThatDoesNotFitItself) {
  const auto gait = [](const std::string& keys) {
    return message(changed("{channel: previous_action}", "{channel: gait_cosine, frequency_hz: 1, " + keys + "}") +
                   kWalking);
  };
  EXPECT_SENTENCE(gait("phases: [0, 3], standing: [3]"));
  for (const char* stance : {"0", "1", "-0.5", "1.5"}) EXPECT_SENTENCE(gait(std::string("stance: ") + stance));
  EXPECT_SENTENCE(message(changed("{channel: previous_action}", "{channel: tick, stance: 0.5}")));
}

TEST(IoDescriptor, AnActionIsAroundWhatItsJointOrElseAllJointsSay) {
  const auto around = [](const std::string& all, const std::string& one) {
    const std::string text = changed("action: 0.25}", "action: 0.25" + one + "}") + all;
    return parse_descriptor(text, "x.yaml").joints[0].around_reference;
  };
  EXPECT_FALSE(around("", ""));
  EXPECT_TRUE(around("", ", around: reference"));
  EXPECT_TRUE(around("action: {around: reference}\n", ""));
  EXPECT_FALSE(around("action: {around: reference}\n", ", around: default"));
  EXPECT_SENTENCE(message(changed("action: 0.25}", "action: 0.25, around: zero}")));
  EXPECT_SENTENCE(message(changed("effort: 5}", "effort: 5, around: reference}")));
}

TEST(IoDescriptor, AnInputIsMadeOfPartsOrIsAState) {
  const Descriptor d = parse_descriptor(std::string(kSmall) + "  - {name: h, state: next_h}\n", "x.yaml");
  EXPECT_EQ(d.observation.inputs[1].state, "next_h");
  EXPECT_TRUE(d.observation.inputs[1].parts.empty());
  EXPECT_SENTENCE(message(std::string(kSmall) + "  - {name: h, state: next_h, parts: [{groups: [first]}]}\n"));
  EXPECT_SENTENCE(message(std::string(kSmall) + "  - {name: h}\n"));
}

TEST(IoDescriptor, ACardByPathIsLookedForFromTheDescriptor) {
  const std::string text = changed("robot: g1", "robot: ../cards/mine.yaml");
  EXPECT_EQ(parse_descriptor(text, "/a/descriptors/x.yaml").robot, "/a/cards/mine.yaml");
  EXPECT_EQ(parse_descriptor(changed("robot: g1", "robot: /b/mine.yaml"), "/a/x.yaml").robot, "/b/mine.yaml");
  EXPECT_EQ(parse_descriptor(kSmall, "/a/x.yaml").robot, "g1");
}

TEST(IoDescriptor, ATextWithAColonIsRefusedWithTheRemedy) {
  EXPECT_SENTENCE(message(changed("about: two joints", "about: legs: two joints")));
  EXPECT_EQ(parse_descriptor(changed("about: two joints", "about: 'legs: two'"), "x.yaml").about, "legs: two");
}

TEST(IoDescriptor, RefusesWhatIsNoDescriptorAtAll) {
  for (const char* text : {"", "[]", "name: [", "joints: 3", "\xff\xfe"}) EXPECT_SENTENCE(message(text));
}

TEST(IoDescriptor, AllThatShipAreReadAndNameTheirCards) {
  int shipped = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DUET_SOURCE_DIR "/controllers/descriptors")) {
    const Descriptor descriptor = read_descriptor(entry.path().string());
    EXPECT_EQ(descriptor.name, entry.path().stem());
    EXPECT_THAT(controller_names(), testing::Contains(descriptor.name));
    EXPECT_TRUE(std::filesystem::exists(card_path(descriptor.robot))) << descriptor.name;
    ++shipped;
  }
  EXPECT_GE(shipped, 14);
}

Descriptor descriptor() {
  Descriptor made;
  made.file = "d.yaml";
  made.name = "d";
  made.joints = {{.name = "left_hip_joint", .neutral = -0.1, .kp = 100.0, .kd = 2.0, .effort = {}, .action = 0.25},
                 {.name = "right_hip_joint", .neutral = -0.1, .kp = 100.0, .kd = 2.0, .effort = {}, .action = 0.25},
                 {.name = "waist_joint", .neutral = 0.0, .kp = 50.0, .kd = 1.0, .effort = {}, .action = 0.5}};
  return made;
}

std::vector<std::string> compared(const std::map<std::string, std::string>& metadata) {
  return compare_with_network(descriptor(), metadata, "net.onnx");
}

TEST(NetworkFacts, ThatAgreeAreNotSaidHoweverTheyAreSpelled) {
  for (const char* names :
       {"left_hip_joint,right_hip_joint,waist_joint", "[\"left_hip_joint\", \"right_hip_joint\", \"waist_joint\"]",
        "['Left_Hip', 'Right_Hip', 'Waist']", "left-hip-joint right-hip-joint waist-joint"})
    for (const char* key : {"joint_names", "dof_names", "JOINT_NAMES"})
      EXPECT_THAT(compared({{key, names},
                            {"joint_stiffness", "100.000,100,50.0"},
                            {"kd", "[2.0, 2, 1]"},
                            {"default_joint_pos", "-0.1004,-0.1,0.000"},
                            {"action_scale", "0.25,0.25,0.5"}}),
                  IsEmpty())
          << names;
  EXPECT_THAT(compared({}), IsEmpty());
  EXPECT_THAT(compared({{"run_path", "x"}, {"observation_names", "a,b"}}), IsEmpty());
  EXPECT_THAT(compared({{"joint_stiffness", "1,2"}}), IsEmpty());  // of nobody knows which
}

TEST(NetworkFacts, ThatDifferAreSaidWithBothNumbers) {
  EXPECT_THAT(compared({{"joint_stiffness", "100,102,51"}}),
              ElementsAre("d.yaml: controller 'd': 'joint_stiffness' of net.onnx is 102 for 'right_hip_joint', the "
                          "descriptor's 'kp' is 100, and 1 joints more differ"));
  EXPECT_SENTENCE(compared({{"dof_names", "left_hip_joint,right_hip_joint,waist_joint"},
                            {"kd", "[2, 2, 1.5]"},
                            {"default_joint_pos", "-0.1,-0.1,0.3"},
                            {"action_scale", "0.25"}}));
  EXPECT_THAT(compared({{"joint_names", "left_hip_joint,right_hip_joint,torso_joint"}, {"kp", "1,2,3"}}),
              ElementsAre(HasSubstr("'joint_names' of net.onnx names 3 joints, 'torso_joint' among them")));
}

TEST(NetworkFacts, JointsInAnotherOrderAreRefusedWithWhatElseDiffers) {
  const std::string message = test::thrown_message<InputError>([] {
    compared({{"joint_names", "right_hip_joint,left_hip_joint,waist_joint"},
              {"joint_stiffness", "100,101,50"},
              {"kp", "100,102,50"}});
  });
  EXPECT_SENTENCE(message);
  // Numbers are compared by the names that they are for.
  EXPECT_THAT(test::thrown_message<InputError>([] {
                compared({{"joint_names", "waist_joint,left_hip_joint,right_hip_joint"}, {"kp", "50,100,100"}});
              }),
              testing::Not(HasSubstr("'kp'")));
}

// The networks do not ship; where they are, the descriptors of this tree agree with what they say of themselves.
TEST(NetworkFacts, OfPublishedNetworksAreThoseOfOurDescriptors) {
  int found = 0;
  for (const char* name : {"beyond_mimic", "holosoma", "holosoma_fastsac", "holosoma_t1"}) {
    const Descriptor own = load_descriptor(name);
    const std::string path = [&] {
      try {
        return find_network(own);
      } catch (const MissingError&) {
        return std::string();
      }
    }();
    if (path.empty()) continue;
    ++found;
    EXPECT_THAT(compare_with_network(own, load_network_file(path).metadata, path), IsEmpty()) << name;
  }
  if (found == 0) GTEST_SKIP() << "not run: no published network that describes itself is here";
}

}  // namespace
}  // namespace duet
