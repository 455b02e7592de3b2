// Descriptors imported from what makers say of their networks: of files made here, and of the published ones, whose
// import commands what our own descriptors of them do.
#include "duet/controllers/import/descriptor_import.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <onnx/onnx_pb.h>

#include "duet/controllers/descriptor_controller.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/controllers/published_cases.h"
#include "tests/nn/onnx_writer.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Networks whose every action is a tenth of the sum of what they see, with metadata.
std::string network(int inputs, int outputs, const std::map<std::string, std::string>& metadata, bool step = false) {
  test::OnnxWriter file;
  file.input("obs", {1, inputs});
  if (step) file.input("time_step", {1, 1});
  file.constant("w", {inputs, outputs}, std::vector<float>(static_cast<std::size_t>(inputs) * outputs, 0.1F));
  file.node("MatMul", {"obs", "w"}, {"actions"}).output("actions");
  if (step) file.node("Identity", {"time_step"}, {"time"}).output("time");
  for (const auto& [key, value] : metadata) {
    auto* entry = file.model().add_metadata_props();
    entry->set_key(key);
    entry->set_value(value);
  }
  return file.bytes();
}

std::string listed(const std::vector<std::string>& items) { return fmt::format("{}", fmt::join(items, ",")); }
std::string repeated(const std::string& item, int count) { return listed(std::vector<std::string>(count, item)); }

// The G1's joints, the last one first.
std::vector<std::string> backwards() {
  std::vector<std::string> names = test::body("g1")->joint_names();
  std::ranges::reverse(names);
  return names;
}

struct ImportTest : ::testing::Test {
  static ImportedDescriptor imported(const ImportRequest& request) { return import_descriptor(request); }
  std::string write(const std::string& name, const std::string& text) {
    write_file(folder / name, text);
    return folder / name;
  }
  std::string refusal(const ImportRequest& request) {
    std::string message = thrown_message<InputError>([&] { import_descriptor(request); });
    for (std::size_t at = message.find(folder / ""); at != std::string::npos; at = message.find(folder / ""))
      message.erase(at, (folder / "").size());
    return message;
  }

  test::ScratchFolder folder;
  std::map<std::string, std::string> mimic = {
      {"joint_names", listed(backwards())},
      {"joint_stiffness", repeated("40.179", 29)},
      {"joint_damping", repeated("2.558", 29)},
      {"default_joint_pos", repeated("0.100", 29)},
      {"action_scale", repeated("0.548", 29)},
      {"command_names", "twist"},
      {"observation_names", "base_ang_vel,projected_gravity,command,joint_pos,joint_vel,actions"}};
};

TEST_F(ImportTest, OfMjlabHasItsJointsTermsAndAssumptions) {
  const ImportedDescriptor made = imported({.file = write("walker.onnx", network(96, 29, mimic))});
  EXPECT_EQ(made.kind, "BeyondMimic or mjlab");
  EXPECT_EQ(made.name, "walker");
  EXPECT_EQ(made.robot, "g1");
  const Descriptor d = parse_descriptor(made.text, "walker.yaml");
  ASSERT_EQ(d.joints.size(), 29U);
  EXPECT_EQ(d.joints[28].name, "left_hip_pitch_joint");
  EXPECT_NEAR(*d.joints[28].action, 0.25 * 88.0 / 40.179, 1e-8) << "the quotient that the file rounds";
  EXPECT_EQ(*d.joints[0].action, 0.548) << "a wrist's effort gives no such quotient";
  EXPECT_EQ(d.joints[0].neutral, 0.1);
  EXPECT_EQ(d.network, "walker.onnx");
  EXPECT_TRUE(d.command.has_value());
  EXPECT_SENTENCE(made.assumed);
  EXPECT_THAT(made.text, HasSubstr("- {channel: command_velocity}  # command\n"));
  EXPECT_THAT(made.text, HasSubstr("joints:  # from 'joint_names'; kp: 'joint_stiffness'"));
  EXPECT_THAT(made.found, Contains(HasSubstr("at its default pose, at rest")));
}

TEST_F(ImportTest, OfATrackerFeedsItsTimeStepAndItsAnchor) {
  mimic["command_names"] = "motion";
  mimic["observation_names"] = "command,motion_anchor_ori_b,base_ang_vel,joint_pos,joint_vel,actions";
  mimic["anchor_body_name"] = "pelvis";
  const ImportedDescriptor made = imported({.file = write("kick.onnx", network(154, 29, mimic, true))});
  const Descriptor d = parse_descriptor(made.text, "kick.yaml");
  ASSERT_EQ(d.observation.inputs.size(), 2U);
  EXPECT_EQ(d.observation.inputs[1].name, "time_step");
  EXPECT_EQ(d.output, "actions");
  EXPECT_FALSE(d.command.has_value());
  EXPECT_THAT(made.text, HasSubstr("anchor_orientation_error, frame: pelvis"));
}

TEST_F(ImportTest, AHistoryThatIsNoWholeNumberOrATrackersTermWithoutItsBodyIsRefused) {
  auto wild = mimic;
  wild["observation_history_lengths"] = "1e300,1,1,1,1,1";
  EXPECT_SENTENCE(refusal({.file = write("wild.onnx", network(96, 29, wild))}));
  mimic["command_names"] = "motion";
  mimic["observation_names"] = "command,motion_anchor_ori_b,base_ang_vel,joint_pos,joint_vel,actions";
  EXPECT_SENTENCE(refusal({.file = write("kick.onnx", network(154, 29, mimic, true))}));
}

TEST_F(ImportTest, AHistoryThatTheFileDoesNotOrderIsAskedFor) {
  const std::string file = write("long.onnx", network(5 * 96, 29, mimic));
  EXPECT_SENTENCE(refusal({.file = file}));
  for (const bool by_frames : {false, true}) {
    const ImportedDescriptor made = imported({.file = file, .history = by_frames ? "frames" : "terms"});
    const Descriptor d = parse_descriptor(made.text, "long.yaml");
    EXPECT_EQ(d.observation.inputs[0].parts.size(), by_frames ? 1U : 6U);
    EXPECT_EQ(d.observation.inputs[0].parts[0].history.frames, 5);
    EXPECT_EQ(d.input_size(d.observation.inputs[0]), 480);
  }
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] { imported({.file = file, .history = "both"}); }),
              HasSubstr("expected frames or terms"));
}

TEST_F(ImportTest, OfHolosomaTakesItsTablesOrItsExperiment) {
  std::map<std::string, std::string> keys = {
      {"dof_names", listed(test::body("g1")->joint_names())},
      {"kp", repeated("50", 29)},
      {"kd", repeated("2", 29)},
      {"command_ranges", R"({"lin_vel_x": [-0.5, 1.0], "lin_vel_y": [-1.0, 1.0], "ang_vel_yaw": [-1.0, 1.0]})"}};
  const ImportedDescriptor four = imported({.file = write("four.onnx", network(100, 29, keys))});
  EXPECT_SENTENCE(four.assumed);
  const Descriptor own = load_descriptor("holosoma"), d = parse_descriptor(four.text, "four.yaml");
  EXPECT_EQ(d.input_layout(d.observation.inputs[0]), own.input_layout(own.observation.inputs[0]));
  EXPECT_EQ(d.joints[3].neutral, own.joints[3].neutral);
  EXPECT_EQ(d.command->forward.lower, -0.5);
  keys["experiment_config"] =
      R"({"robot": {"control": {"control_type": "P", "action_scale": 0.5, "action_clip_value": 20.0,
    "action_scales_by_effort_limit_over_p_gain": false}, "init_state": {"default_joint_angles": {"left_knee_joint": 0.7}}},
    "simulator": {"config": {"sim": {"fps": 200, "control_decimation": 2}}},
    "observation": {"groups": {"actor_obs": {"history_length": 2, "terms": {"dof_vel": {"scale": 0.05, "clip": null},
    "actions": {"scale": 1.0, "clip": [-5, 5]}, "dof_pos": {"scale": 1.0}}}}}})";
  const ImportedDescriptor made = imported({.file = write("whole.onnx", network(2 * 87, 29, keys))});
  const Descriptor e = parse_descriptor(made.text, "whole.yaml");
  EXPECT_EQ(e.rate_hz, 100.0);
  EXPECT_EQ(e.action_clip, 20.0);
  EXPECT_EQ(e.joints[3].neutral, 0.7);
  EXPECT_EQ(e.joints[0].neutral, 0.0);
  EXPECT_EQ(*e.joints[0].action, 0.5);
  ASSERT_EQ(e.observation.groups.size(), 3U);
  EXPECT_EQ(e.observation.groups[0].channels[0].kind, ChannelKind::kPreviousAction) << "terms go by their names";
  EXPECT_EQ(e.observation.groups[0].channels[0].clip, 5.0);
  std::string tracker = keys["experiment_config"];
  tracker.replace(tracker.find("\"dof_pos\""), 9, "\"motion_ref_ori_b\": {\"scale\": 1.0}, \"dof_pos\"");
  keys["experiment_config"] = tracker;
  EXPECT_SENTENCE(refusal({.file = write("bodiless.onnx", network(2 * 93, 29, keys))}));
  keys["experiment_config"] = tracker.substr(0, tracker.size() - 1) +
                              R"(, "command": {"setup_terms": {"motion_command": {"params": {"motion_config":
    {"body_name_ref": ["torso_link"]}}}}}})";
  EXPECT_THAT(imported({.file = write("tracker.onnx", network(2 * 93, 29, keys))}).text,
              HasSubstr("anchor_orientation_error, frame: torso_link"));
  keys["experiment_config"] = R"({"robot": {"control": {"control_type": "T"}}})";
  EXPECT_SENTENCE(refusal({.file = write("torque.onnx", network(87, 29, keys))}));
}

std::string numbers(const std::vector<double>& values) { return fmt::format("[{}]", fmt::join(values, ", ")); }

// A deployment of the T1 with legs alone, whose network has the right leg before the left one.
std::string lab_yaml(const std::string& more = "") {
  return "joint_ids_map: [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]\nstep_dt: 0.04\n"
         "stiffness: [100, 101, 102, 103, 104, 105, 106, 107, 108, 109, 110, 111]\n"
         "damping: [1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2]\n"
         "default_joint_pos: [0.1, 0, 0, 0, 0, 0, 0.2, 0, 0, 0, 0, 0]\n"
         "commands: {base_velocity: {ranges: {lin_vel_x: [-0.5, 1], lin_vel_y: [0, 0], ang_vel_z: [-1, 1], heading: "
         "null}}}\n"
         "actions: {JointPositionAction: {clip: null, scale: 0.25, offset: [0.1, 0, 0, 0, 0, 0, 0.2, 0, 0, 0, 0, 0]}}\n"
         "observations:\n"
         "  base_ang_vel: {params: {}, clip: [-3, 3], scale: [0.2, 0.2, 0.2], history_length: 2}\n"
         "  gait_phase: {params: {period: 0.8}, clip: null, scale: [1, 1], history_length: 2}\n"
         "  last_action: {params: {}, clip: null, scale: null, history_length: 2}\n" +
         more;
}

TEST_F(ImportTest, ADeploymentOfAnotherNumberOfJointsOrOfWildNumbersIsRefused) {
  EXPECT_SENTENCE(refusal({.file = write("deploy.yaml", lab_yaml()), .robot = "g1"}));
  std::string wild = lab_yaml();
  wild.replace(wild.find("[6, 7"), 2, "[1e300");
  EXPECT_SENTENCE(refusal({.file = write("deploy.yaml", wild), .robot = "t1_12dof"}));
  wild = lab_yaml();
  EXPECT_SENTENCE(
      refusal({.file = write("deploy.yaml", wild.substr(0, wild.find("observations")) + "observations: {}\n"),
               .robot = "t1_12dof"}));
  EXPECT_SENTENCE(refusal({.file = write("gym.yaml", "kps: [1]\nnum_obs: 3\nnum_actions: 1e12\n")}));
}

TEST_F(ImportTest, OfALabsDeploymentPutsItsMotorsInTheNetworksOrder) {
  write("policy.onnx", network(34, 12, {}));
  const ImportedDescriptor made = imported({.file = write("deploy.yaml", lab_yaml()), .robot = "t1_12dof"});
  const Descriptor d = parse_descriptor(made.text, "deploy.yaml");
  EXPECT_EQ(d.rate_hz, 25.0);
  EXPECT_EQ(d.joints[0].name, "Right_Hip_Pitch");
  EXPECT_EQ(d.joints[0].kp, 106.0) << "gains are listed by motor";
  EXPECT_EQ(d.joints[0].kd, 2.0);
  EXPECT_EQ(d.joints[0].neutral, 0.1) << "the pose by the network's order";
  ASSERT_EQ(d.observation.inputs[0].parts.size(), 3U);
  EXPECT_TRUE(d.observation.inputs[0].parts[0].history.starts_full);
  EXPECT_EQ(d.observation.groups[0].channels[0].clip, 3.0);
  EXPECT_EQ(d.observation.groups[1].channels[0].gait.frequency_hz, 1.25);
  EXPECT_TRUE(d.observation.groups[1].channels[0].gait.silent);
  EXPECT_EQ(d.network, "policy.onnx");
  EXPECT_SENTENCE(made.assumed);
  const ImportedDescriptor by_frames =
      imported({.file = write("deploy.yaml", lab_yaml("  use_gym_history: true\n")), .robot = "t1_12dof"});
  EXPECT_EQ(parse_descriptor(by_frames.text, "deploy.yaml").observation.inputs[0].parts.size(), 1U);
}

TEST_F(ImportTest, OfALabsDeploymentTakesItsCommandFromAKeyboardToo) {
  std::string text = lab_yaml();
  text.replace(text.find("base_ang_vel"), 12, "keyboard_velocity_commands");
  write("policy.onnx", network(34, 12, {}));
  const ImportedDescriptor made = imported({.file = write("deploy.yaml", text), .robot = "t1_12dof"});
  const Descriptor d = parse_descriptor(made.text, "deploy.yaml");
  EXPECT_EQ(d.observation.groups[0].channels[0].kind, ChannelKind::kCommandVelocity);
}

// unitree_rl_gym's H1-2 and its G1 have as many joints of the same names.
TEST_F(ImportTest, OfRlGymTakesTheRobotThatItsModelNames) {
  const auto robot_of = [&](const std::string& model, const std::string& robot = "") {
    const std::string text =
        "xml_path: \"{LEGGED_GYM_ROOT_DIR}/resources/robots/" + model +
        "/scene.xml\"\nkps: 100\nkds: 2\ndefault_angles: 0\nang_vel_scale: 0.25\ndof_pos_scale: 1\n"
        "dof_vel_scale: 0.05\naction_scale: 0.25\ncmd_scale: [2, 2, 0.25]\nnum_actions: 12\n"
        "num_obs: 47\n";
    return imported({.file = write("gym.yaml", text), .robot = robot});
  };
  EXPECT_EQ(robot_of("h1_2").robot, "h1_2");
  EXPECT_EQ(robot_of("g1").robot, "g1_12dof") << "the card 'g1' has 29 joints";
  EXPECT_EQ(robot_of("h1_2", "t1_12dof").robot, "t1_12dof");
  EXPECT_SENTENCE(robot_of("h1_2").assumed);
}

TEST_F(ImportTest, OfRlSarTakesNamesAndRateFromTheRobotsFile) {
  std::filesystem::create_directories(folder / "policy");
  write("base.yaml", "robot: {dt: 0.005, decimation: 2, joint_names: " +
                         fmt::format("[{}]", fmt::join(test::body("t1_12dof")->joint_names(), ", ")) + "}\n");
  write("policy/net.onnx", network(3 * 30, 12, {}));
  const std::vector<double> twelve(12, 0.5);
  const std::string text =
      "robot/policy:\n  model_name: net.onnx\n  joint_mapping: [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]\n"
      "  observations: [ang_vel, gravity_vec, dof_vel, actions]\n  observations_history: [2, 1, 0]\n"
      "  observations_history_priority: time\n  clip_obs: 7\n  ang_vel_scale: 0.25\n  dof_vel_scale: 0.05\n"
      "  rl_kp: " +
      numbers(twelve) + "\n  rl_kd: " + numbers(twelve) + "\n  default_dof_pos: " + numbers(twelve) +
      "\n  action_scale: " + numbers(twelve) + "\n  clip_actions_lower: " + numbers(std::vector<double>(12, -2.0)) +
      "\n  clip_actions_upper: " + numbers(std::vector<double>(12, 3.0)) + "\n";
  const ImportedDescriptor made = imported({.file = write("policy/config.yaml", text)});
  const Descriptor d = parse_descriptor(made.text, "config.yaml");
  EXPECT_EQ(made.robot, "t1_12dof");
  EXPECT_EQ(d.rate_hz, 100.0);
  EXPECT_EQ(d.joints[0].name, "Right_Hip_Pitch");
  EXPECT_EQ(d.joints[0].clip->upper, 3.0);
  EXPECT_EQ(d.observation.inputs[0].parts[0].history.frames, 3);
  EXPECT_EQ(d.observation.groups[0].channels[0].clip, 7.0);
  EXPECT_THAT(made.text, HasSubstr("previous_action, clipped: true"));
  std::string newest = text;
  newest.replace(newest.find("[2, 1, 0]"), 9, "[0, 1, 2]");
  EXPECT_SENTENCE(refusal({.file = write("policy/config.yaml", newest)}));
}

TEST_F(ImportTest, SaysInOneSentenceWhatIsNoNetworkToImport) {
  EXPECT_SENTENCE(
      refusal({.file = write("lfs.onnx", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")}));
  EXPECT_SENTENCE(refusal({.file = write("page.onnx", "<!DOCTYPE html><html><head>404</head></html>")}));
  EXPECT_SENTENCE(
      refusal({.file = write("lfs.yaml", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")}));
  EXPECT_SENTENCE(refusal({.file = write("model.pt", "\x80\x02}q\x01.")}));
  EXPECT_SENTENCE(refusal({.file = write("mute.onnx", network(96, 29, {}))}));
  EXPECT_SENTENCE(refusal({.file = write("odd.onnx", network(96, 29, {{"colour", "red"}}))}));
  EXPECT_SENTENCE(refusal({.file = write("suite.yaml", "schema: duet.suite/1\nname: x\n")}));
}

TEST_F(ImportTest, SaysInOneSentenceWhatDoesNotFit) {
  EXPECT_SENTENCE(refusal({.file = write("small.onnx", network(95, 29, mimic))}));
  EXPECT_SENTENCE(refusal({.file = write("large.onnx", network(154, 29, mimic))}));
  EXPECT_SENTENCE(refusal({.file = write("legs.onnx", network(96, 12, mimic))}));
  EXPECT_SENTENCE(refusal({.file = write("w.onnx", network(96, 29, mimic)), .robot = "t1"}));
  auto other = mimic;
  other["observation_names"] = "base_ang_vel,projected_gravty";
  EXPECT_SENTENCE(refusal({.file = write("terms.onnx", network(6, 29, other))}));
  other = mimic;
  other["joint_damping"] = "1,2,3";
  EXPECT_SENTENCE(refusal({.file = write("gains.onnx", network(96, 29, other))}));
  other = mimic;
  other["joint_names"] = "left_wheel";
  EXPECT_SENTENCE(refusal({.file = write("wheels.onnx", network(96, 29, other))}));
  std::string text = lab_yaml();
  text.replace(text.find("offset: [0.1"), 12, "offset: [0.3");
  EXPECT_SENTENCE(refusal({.file = write("offset.yaml", text), .robot = "t1_12dof"}));
  text = lab_yaml();
  text.replace(text.find("[6, 7"), 5, "[6, 99");
  EXPECT_SENTENCE(refusal({.file = write("map.yaml", text), .robot = "t1_12dof"}));
}

// The published files: what is imported moves the robot as our own descriptor does, whatever the two texts look like.
TEST(Import, OfPublishedFilesCommandsWhatOurDescriptorsDo) {
  struct Case {
    const char *file, *own;
    double near;  // of targets: files and descriptors round otherwise [rad]
  };
  int found = 0;
  for (const Case& each : {Case{"models/holosoma/ppo_g1_29dof.onnx", "holosoma", 1e-6},
                           Case{"models/holosoma/ppo_t1_29dof.onnx", "holosoma_t1", 1e-6},
                           Case{"models/unitree_launcher/beyondmimic_29dof.onnx", "beyond_mimic", 2e-3},
                           Case{"models/unitree_rl_lab/deploy.yaml", "unitree_rl_lab", 1e-6},
                           Case{"models/unitree_rl_mjlab/deploy.yaml", "unitree_rl_mjlab", 1e-6},
                           Case{"models/rl_sar/config.yaml", "rl_sar_dance", 1e-5},
                           Case{"arena/g1/spinkick/spinkick_safe.onnx", "spinkick", 1e-3},
                           Case{"arena/g1/g1_deploy_velocity_v0/deploy.yaml", "g1_deploy_velocity", 1e-5},
                           Case{"arena/g1/g1_deploy_AMP/deploy.yaml", "g1_deploy_amp", 1e-6}}) {
    const std::string file = test::shared_file(each.file);
    if (file.empty()) continue;
    ++found;
    const ImportedDescriptor made = import_descriptor({.file = file});
    const Descriptor own = load_descriptor(each.own), theirs = parse_descriptor(made.text, "imported.yaml");
    const auto robot = test::body(own.robot);
    const std::string path = test::published_file(own.network);
    ControllerOptions options;
    if (own.command) options["command"] = "0.4,0.1,-0.2";
    const auto a = make_descriptor_controller(own, robot, load_network(path), path, options);
    const auto b = make_descriptor_controller(theirs, robot, load_network(path), path, options);
    RobotState state = robot->standing_state();
    Reference reference{state.X_WB, state.q};
    a->reset(state);
    b->reset(state);
    JointCommand left, right;
    double apart = 0.0;
    for (int tick = 0; tick < 8; ++tick) {
      state.q = robot->neutral + 0.02 * Eigen::VectorXd::LinSpaced(robot->dof(), -tick, 5.0);
      state.v = 0.1 * Eigen::VectorXd::LinSpaced(robot->dof(), 1.0, -tick);
      state.w_WB_B = {0.1 * tick, -0.2, 0.3};
      reference.q = state.q.reverse();
      a->act(state, reference, left);
      b->act(state, reference, right);
      apart = std::max(apart, (left.q_target - right.q_target).cwiseAbs().maxCoeff());
    }
    EXPECT_LE(apart, each.near) << each.own;
    EXPECT_LE((left.kp - right.kp).cwiseAbs().maxCoeff(), 0.11) << each.own;
    EXPECT_EQ(theirs.rate_hz, own.rate_hz);
  }
  if (found == 0) GTEST_SKIP() << "not run: published networks absent";
}

}  // namespace
}  // namespace duet
