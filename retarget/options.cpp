#include "duet/retarget/options.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "duet/core/names.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"

namespace duet {
namespace {

using Options = PairOptions;

FieldDoc words(const char* name, const char* meaning, FieldRange range = {}, const char* unit = "") {
  return {.name = name, .meaning = meaning, .unit = unit, .range = range};
}

// A number, zero or more, or one of the names of an enumeration.
template <typename Member>
Field<Options> amount(const char* name, const char* meaning, Member member, const char* unit = "") {
  return field<Options>(words(name, meaning, {.low = 0.0}, unit), member);
}
template <typename Member>
Field<Options> choice(const char* name, const std::vector<std::string>& names, const char* meaning, Member member) {
  return field<Options>({.name = name, .meaning = meaning, .choices = names}, member);
}
Field<Options> flag(const char* name, const char* meaning, bool Options::*member) {
  return choice(name, {"off", "on"}, meaning, member);
}

// It sets all others.
Field<Options> mode_field() {
  Field<Options> mode =
      choice("mode", {"paper", "grounded", "best"},
             "as printed, standing on the ground, or that with L-BFGS; sets the options below", &Options::mode);
  mode.assign = [set = mode.assign](Options& options, const std::string& text, const FieldRange& range) {
    Options asked;
    std::string expected = set(asked, text, range);
    if (expected.empty()) options = pair_options_of(asked.mode);
    return expected;
  };
  return mode;
}

Field<Options> keypoint_list() {
  return field<Options>(
      words("keypoint-list", "in the place of keypoints"), "joint[@frame][:weight[:object]], by commas",
      [](const Options& o) { return format_contact_keypoints(o.keypoint_list); },
      [](Options& o, const std::string& text) -> std::string {
        try {
          o.keypoint_list = parse_contact_keypoints(text);
        } catch (const std::invalid_argument& error) {
          return error.what();
        }
        return "";
      });
}

void add_weights(FieldTable<Options>& table) {
  const auto weight = [&](const char* name, const char* meaning, double PairWeights::*member) {
    table.push_back(amount(
        name, meaning, [member](auto& o) -> auto& { return o.weights.*member; }));
  };
  weight("w-kin", "of L_kin, the pose", &PairWeights::kin);
  weight("w-con", "of L_con, the distances between the two", &PairWeights::con);
  weight("w-hum", "of L_hum, the partner's own pose", &PairWeights::hum);
  weight("w-temp", "of L_temp, smoothness", &PairWeights::temp);
  weight("w-acceleration", "of the accelerations in L_temp", &PairWeights::acceleration);
  weight("w-pose", "of L_pose, the robot's neutral pose", &PairWeights::pose);
  weight("w-bone", "of the lengths of the partner's bones, collars to wrists; 0 as printed", &PairWeights::bone);
  weight("w-partner", "of L_temp of the partner's offsets, as a share of w-temp; 0 as printed", &PairWeights::partner);
  weight("w-collision", "of the depth of spheres of the two bodies in each other; 0 as printed",
         &PairWeights::collision);
  weight("w-object", "of the distances to a carried object, as a share of w-con; 0: no object", &PairWeights::object);
  weight("w-hand", "of a hand as a keypoint of contact; a keypoint-list has weights of its own", &PairWeights::hand);
}

void add_schedule(FieldTable<Options>& table) {
  const auto add = [&](const char* name, const char* meaning, auto member) {
    table.push_back(amount(
        name, meaning, [member](auto& o) -> auto& { return o.schedule.*member; }));
  };
  add("stage1-iterations", "of stage 1", &PairSchedule::stage1_iterations);
  add("stage1-rate", "Adam's learning rate in stage 1", &PairSchedule::stage1_rate);
  add("stage2-iterations", "of stage 2", &PairSchedule::stage2_iterations);
  add("stage2-rate", "Adam's learning rate in stage 2", &PairSchedule::stage2_rate);
  add("stage2-contact-scale", "of w-con in stage 2", &PairSchedule::stage2_contact_scale);
  table.push_back(choice(
      "keep-moments", {"off", "on"}, "Adam's moments, across the stages",
      [](auto& o) -> auto& { return o.schedule.keep_moments; }));
  add("adam-epsilon", "Adam's epsilon", &PairSchedule::epsilon);
}

FieldTable<Options> make_table() {
  FieldTable<Options> table = {mode_field()};
  table.reserve(48);
  add_weights(table);
  add_schedule(table);
  for (Field<Options>& more : FieldTable<Options>{
           choice("kin-loss", {"squared", "mean-norm"}, "sum of squares over pairs, 1/T, or PHC's mean norm",
                  &Options::kin_loss),
           choice("contact-reduction", {"frobenius", "mean"}, "as printed, 1/T, or 1/(T N^2)",
                  &Options::contact_reduction),
           choice("contact-blocks", {"full", "cross-and-human", "cross"},
                  "distances: all, without robot to robot, or robot to human only", &Options::contact_blocks),
           choice("root", {"constant-offset", "per-frame", "fixed"}, "how the root may move",
                  &Options::root_translation),
           choice("keypoints", {"nine", "eleven", "seven"},
                  "head, shoulders, elbows, wrists, hands; with hips; without hands", &Options::keypoints),
           keypoint_list(),
           choice("rest-pose", {"zero", "neutral"},
                  "where L_pose pulls each joint and the search begins: 0 as printed, or the card's neutral pose",
                  &Options::rest_pose),
           amount("contact-range",
                  "robot-human distances count fully up to half of it, and not at all beyond it; 0: all count",
                  &Options::contact_range, "m"),
           flag("joint-speeds", "keeps every joint within the card's limit of its speed", &Options::joint_speeds),
           flag("filter", "Gaussian over time, kernel 5, sigma 0.75, once at the end", &Options::filter),
           flag("adapt-human", "whether the partner is moved", &Options::adapt_human),
           choice("kernel", {"auto", "scalar", "portable", "v2", "v3", "v4"},
                  "double reference (scalar) or float lanes: any processor, x86-64-v2, AVX2, AVX-512",
                  &Options::kernel),
           choice("optimizer", {"adam", "lbfgs"}, "Adam in two stages, or L-BFGS", &Options::optimizer),
           amount("lbfgs-iterations", "of L-BFGS, the first eight with the weights of stage 1",
                  &Options::lbfgs_iterations),
           amount("lbfgs-tolerance", "of L-BFGS: three steps that each lower the objective by a smaller share end it",
                  &Options::lbfgs_tolerance),
           flag("ground", "the robot stands: soles where the person's feet do", &Options::ground),
           amount("root-smoothing", "standard deviation of the base's smoothing, where ground is on",
                  &Options::root_smoothing, "s"),
           amount("step-speed", "of a foot that steps, in the mean, at most; where ground is on", &Options::step_speed,
                  "m/s"),
           field<Options>(words("smpl", "SMPL shape basis (NPZ); where there is none bone lengths are scaled"),
                          &Options::smpl_path)})
    table.push_back(std::move(more));
  return table;
}

const Field<Options>& known_option(const std::string& name) {
  if (const Field<Options>* known = find_field(pair_option_table(), name)) return *known;
  throw std::invalid_argument(unknown_name_message("pair option", name, pair_option_names()));
}

}  // namespace

const FieldTable<PairOptions>& pair_option_table() {
  static const FieldTable<PairOptions> table = make_table();
  return table;
}

std::vector<std::string> pair_option_names() { return field_names(pair_option_table()); }

PairOptions pair_options_of(PairMode mode) {
  PairOptions options;
  options.mode = mode;
  if (mode == PairMode::kPaper) return options;
  options.ground = true;
  options.contact_blocks = ContactBlocks::kCrossAndHuman;
  options.weights.bone = 5.0;
  options.weights.partner = 0.2;
  options.weights.collision = 60.0;
  options.weights.hand = 3.0;
  options.step_speed = 1.8;
  if (mode != PairMode::kBest) return options;
  options.optimizer = Optimizer::kLbfgs;
  options.lbfgs_iterations = 120;
  options.lbfgs_tolerance = 2e-6;
  options.rest_pose = RestPose::kNeutral;
  options.weights.kin = 4.0;
  options.weights.pose = 2.5;
  options.weights.hand = 5.0;
  options.contact_range = 2.0;
  options.joint_speeds = true;
  return options;
}

PairOptions make_pair_options(const std::vector<std::pair<std::string, std::string>>& choices) {
  PairOptions options;
  for (const bool mode : {true, false}) {
    for (const auto& [name, value] : choices)
      if ((name == "mode") == mode) set_pair_option(options, name, value);
  }
  return options;
}

void set_pair_option(PairOptions& options, const std::string& name, const std::string& value) {
  const std::string expected = set_field(known_option(name), options, value);
  require(expected.empty(), "pair option '{}' has no value '{}': {}", name, value, expected);
}

std::string pair_option(const PairOptions& options, const std::string& name) {
  return known_option(name).text(options);
}

void validate(const PairOptions& options) {
  for (const std::string& name : pair_option_names()) {
    PairOptions copy;
    set_pair_option(copy, name, pair_option(options, name));
  }
  require(
      !options.ground || options.root_translation != RootTranslation::kPerFrame,
      "pair options: root=per-frame would lift a robot that stands on the ground; expected constant-offset or fixed");
  require(!options.ground || options.step_speed > 0.0, "pair options: step-speed is 0; expected a speed above 0");
  require(options.optimizer == Optimizer::kAdam || options.lbfgs_iterations > 0,
          "pair options: lbfgs-iterations is 0; expected at least one iteration");
  require(options.schedule.stage1_iterations + options.schedule.stage2_iterations > 0,
          "pair options: stage1-iterations and stage2-iterations are both 0; expected at least one iteration");
}

namespace {

double weight_of(std::string_view text, std::string_view entry) {
  const std::optional<double> value = parse_number(text);
  require(value.has_value() && *value >= 0.0,
          "keypoint '{}': expected a weight, a finite number of zero or more, found '{}'", entry, text);
  return *value;
}

ContactKeypoint keypoint_of(std::string_view entry) {
  const std::vector<std::string_view> parts = split(entry, ':');
  require(parts.size() <= 3, "keypoint '{}': expected joint[@frame][:weight[:object]]", entry);
  const std::vector<std::string_view> names = split(parts[0], '@');
  require(names.size() <= 2 && !(names.size() == 2 && names[1].empty()),
          "keypoint '{}': expected joint[@frame][:weight[:object]]", entry);
  const auto joint = std::find(kSmplNames.begin(), kSmplNames.end(), names[0]);
  if (joint == kSmplNames.end()) {
    const std::vector<std::string> known(kSmplNames.begin(), kSmplNames.end());
    throw std::invalid_argument(unknown_name_message("joint", std::string(names[0]), known));
  }
  ContactKeypoint keypoint;
  keypoint.smpl = static_cast<int>(joint - kSmplNames.begin());
  if (names.size() == 2) keypoint.frame = names[1];
  if (parts.size() > 1) keypoint.weight = weight_of(parts[1], entry);
  if (parts.size() > 2) keypoint.object = weight_of(parts[2], entry);
  return keypoint;
}

// The frame that the card pairs with the joint: a keypoint of interaction, else one of the 16 pairs.
int frame_of_card(const RobotModel& robot, int smpl) {
  for (const Keypoint& key : robot.keypoints)
    if (key.smpl == smpl) return key.frame;
  for (const RetargetPair& pair : robot.pairs)
    if (pair.smpl == smpl) return pair.frame;
  throw std::invalid_argument(fmt::format("robot '{}': its card pairs no frame with the joint '{}'; expected {}@frame",
                                          robot.name, kSmplNames[static_cast<std::size_t>(smpl)],
                                          kSmplNames[static_cast<std::size_t>(smpl)]));
}

bool is_one_of(int smpl, int left, int right) { return smpl == left || smpl == right; }

}  // namespace

std::vector<ContactKeypoint> parse_contact_keypoints(const std::string& text) {
  std::vector<ContactKeypoint> keypoints;
  if (text.empty()) return keypoints;
  for (const std::string_view entry : split(text, ',')) {
    ContactKeypoint keypoint = keypoint_of(entry);
    for (const ContactKeypoint& other : keypoints)
      require(other.smpl != keypoint.smpl, "keypoint '{}': its joint is named twice", entry);
    keypoints.push_back(std::move(keypoint));
  }
  return keypoints;
}

std::string format_contact_keypoints(const std::vector<ContactKeypoint>& keypoints) {
  std::string text;
  for (const ContactKeypoint& keypoint : keypoints) {
    if (!text.empty()) text += ',';
    text += kSmplNames[static_cast<std::size_t>(keypoint.smpl)];
    if (!keypoint.frame.empty()) text += "@" + keypoint.frame;
    const bool has_object = keypoint.object != kObjectByRule;
    if (keypoint.weight != 1.0 || has_object) text += fmt::format(":{}", keypoint.weight);
    if (has_object) text += fmt::format(":{}", keypoint.object);
  }
  return text;
}

std::vector<int> robot_frames(const RobotModel& robot, const std::vector<ContactKeypoint>& keypoints) {
  std::vector<int> frames;
  frames.reserve(keypoints.size());
  for (const ContactKeypoint& keypoint : keypoints)
    frames.push_back(keypoint.frame.empty() ? frame_of_card(robot, keypoint.smpl) : robot.frame_index(keypoint.frame));
  return frames;
}

std::vector<double> object_weights(const std::vector<ContactKeypoint>& keypoints) {
  const bool hands = std::any_of(keypoints.begin(), keypoints.end(), [](const ContactKeypoint& keypoint) {
    return is_one_of(keypoint.smpl, kLeftHand, kRightHand);
  });
  std::vector<double> weights;
  weights.reserve(keypoints.size());
  for (const ContactKeypoint& keypoint : keypoints) {
    const bool chosen =
        hands ? is_one_of(keypoint.smpl, kLeftHand, kRightHand) : is_one_of(keypoint.smpl, kLeftWrist, kRightWrist);
    weights.push_back(keypoint.object != kObjectByRule ? keypoint.object : chosen ? 1.0 : 0.0);
  }
  return weights;
}

}  // namespace duet
