#include "controllers/descriptor.h"

#include <gmock/gmock.h>

#include "controllers/published.h"
#include "core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::HasSubstr;

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
  EXPECT_EQ(d.groups[0].channels[0].joints, (std::vector<int>{1, 0}));
  EXPECT_EQ(d.groups[0].channels[1].clip, 4.0);
  EXPECT_TRUE(d.inputs[0].parts[0].starts_full);
  EXPECT_EQ(d.input_size(d.inputs[0]), 3 * 6 + 5);
  EXPECT_EQ(
      d.input_layout(d.inputs[0]),
      "previous_action 0, joint_position 1..2, base_angular_velocity 3..5 (3 frames of 6); joint_position 18..19, "
      "base_angular_velocity 20..22");
  EXPECT_FALSE(d.walks);
  EXPECT_FALSE(d.command.has_value());
}

TEST(IoDescriptor, RefusesWhatItDoesNotKnowWithFileLineAndNearest) {
  EXPECT_EQ(
      message(changed("licence: none", "license: none")),
      "x.yaml:3: IO descriptor: unknown key 'license': did you mean 'licence'? Known: name, about, licence, robot, "
      "network, rate_hz, walks, waist, joints, other_joints, observation, inputs, action, command");
  EXPECT_THAT(message(changed("channel: joint_position", "channel: joint_positions")),
              HasSubstr("x.yaml:12: channel 'joint_positions': unknown channel 'joint_positions': did you mean "
                        "'joint_position'?"));
  EXPECT_THAT(message(changed("joints: [b, a]", "joints: [b, c]")),
              HasSubstr("x.yaml:12: channel 'joint_position': unknown joint 'c'"));
  EXPECT_THAT(message(changed("groups: [first]", "groups: [frist]")),
              HasSubstr("x.yaml:20: part: unknown group 'frist': did you mean 'first'?"));
}

TEST(IoDescriptor, RefusesKeysOfAnotherChannel) {
  EXPECT_THAT(
      message(changed("{channel: previous_action}", "{channel: previous_action, phases: [0]}")),
      HasSubstr("x.yaml:15: channel 'previous_action': expected no key 'phases' in a previous_action, found one"));
  EXPECT_THAT(message(changed("{channel: previous_action}", "{channel: gait_sine}")),
              HasSubstr("expected the key 'frequency_hz'"));
  EXPECT_THAT(message(changed("{channel: previous_action}", "{channel: constant}")),
              HasSubstr("expected the key 'values'"));
  EXPECT_THAT(message(changed("{channel: previous_action}", "{channel: reference_frames, steps: [0]}")),
              HasSubstr("'steps': expected a whole number in [1, 1000], found 0"));
}

TEST(IoDescriptor, RefusesValuesOutOfRange) {
  EXPECT_THAT(message(changed("rate_hz: 50", "rate_hz: 100")),
              HasSubstr("x.yaml:6: IO descriptor: 'rate_hz': expected 50, found 100"));
  EXPECT_THAT(message(changed("kp: 10", "kp: -10")), HasSubstr("joint 'a': 'kp': expected a number >= 0, found -10"));
  EXPECT_THAT(message(changed("kp: 10", "kp: .nan")), HasSubstr("'kp': expected a finite number"));
  EXPECT_THAT(message(changed("effort: 5", "effort: 0")), HasSubstr("'effort': expected a number > 0, found 0"));
  EXPECT_THAT(message(changed("scale: [1, 2, 3]", "scale: [1, 2]")),
              HasSubstr("'scale': expected 1 or 3 numbers, found 2"));
  EXPECT_THAT(message(changed("frames: 3", "frames: 2.5")),
              HasSubstr("'frames': expected a whole number in [1, 1000], found 2.5"));
  EXPECT_THAT(message(changed("start: repeated", "start: ones")), HasSubstr("unknown start 'ones'"));
  EXPECT_THAT(message(changed("{name: b,", "{name: a,")), HasSubstr("expected each joint once, found 'a' again"));
  EXPECT_THAT(message(changed(", action: 0.25", "")), HasSubstr("expected one that has the key 'action', found none"));
  EXPECT_THAT(message(std::string(kSmall) + "command: {forward: {limits: [1, -1]}}\n"),
              HasSubstr("forward: 'limits': expected [lower, upper], found a list of 2"));
}

TEST(IoDescriptor, RefusesWhatIsNoDescriptorAtAll) {
  for (const char* text : {"", "[]", "name: [", "joints: 3", "\xff\xfe"})
    EXPECT_THAT(message(text), HasSubstr("x.yaml:")) << text;
}

TEST(IoDescriptor, AllThatShipAreReadAndNameTheirCards) {
  for (const char* name : {"homie", "twist2", "playground", "rl_gym", "gmt", "beyond_mimic"}) {
    const Descriptor descriptor = load_descriptor(name);
    EXPECT_EQ(descriptor.name, name);
    const std::string card = std::string(DUET_SOURCE_DIR) + "/robots/g1/" + descriptor.robot + ".yaml";
    EXPECT_TRUE(std::filesystem::exists(card)) << card;
  }
}

}  // namespace
}  // namespace duet
