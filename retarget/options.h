// Options of PAIR: the weights and schedule of supplement A.1.2, and every reading where the text leaves a gap. Names
// and defaults as in docs/deviations.md; the defaults are the `paper` mode. docs/retargeting.md tells the modes apart.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "duet/core/field.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Which joints of the person and points of the robot stand for each other in PAIR's contact term, K_H and K_R of
// supplement A.1.1, and with what weight: data that a user may name ("By redefining task contact keypoints", Fig. S3).

inline constexpr double kObjectByRule = -1.0;

struct ContactKeypoint {
  int smpl = 0;                   // SMPL-24 joint of the person
  std::string frame = {};         // of the robot; empty: what its card pairs with that joint
  double weight = 1.0;            // w_i: a distance between keypoints i and j counts w_i w_j times
  double object = kObjectByRule;  // likewise for its distances from a carried object, or by the rule
  bool operator==(const ContactKeypoint&) const = default;
};

// "left_hand:2,right_hand:2:1,left_wrist@left_wrist_yaw_link": joint[@frame][:weight[:object]], by commas. Throws
// std::invalid_argument that says what was expected: an unknown joint, one that is named twice, a weight that is no
// finite number of zero or more.
std::vector<ContactKeypoint> parse_contact_keypoints(const std::string& text);
std::string format_contact_keypoints(const std::vector<ContactKeypoint>& keypoints);

// The robot's frame of each. Throws std::invalid_argument naming the robot: a frame that it has not, a joint that its
// card pairs with nothing.
std::vector<int> robot_frames(const RobotModel& robot, const std::vector<ContactKeypoint>& keypoints);

// Weights of the distances from an object where the rule decides: 1 for hands, or for wrists where there is no hand
// among the keypoints, else 0.
std::vector<double> object_weights(const std::vector<ContactKeypoint>& keypoints);

struct PairWeights {  // supplement A.1.2, stage 1
  double kin = 1.0;
  double con = 0.25;
  double hum = 0.25;
  double temp = 5.0;
  double acceleration = 1.0;  // w_a of L_temp, not given in the text
  double pose = 0.02;
  // Weights of the modes on the ground; the paper does not have them.
  double bone = 0.0;       // the partner's bones, collars to wrists, keep their lengths
  double partner = 0.0;    // L_temp of the partner's offsets, as a share of `temp`
  double collision = 0.0;  // depth of spheres of the two bodies in each other
  double object = 1.0;     // of distances from a carried object, as a share of `con`; 0 leaves the object out
  double hand = 1.0;       // of a hand as a keypoint of contact, where none are listed
};

struct PairSchedule {
  int stage1_iterations = 150;
  double stage1_rate = 0.02;  // Adam's learning rate
  int stage2_iterations = 50;
  double stage2_rate = 0.005;
  double stage2_contact_scale = 10.0;
  bool keep_moments = true;  // Adam's moments across the stages
  double epsilon = 1e-8;     // Adam's, not given in the text: the common default
};

enum class PairMode { kPaper, kGrounded, kBest };
enum class Optimizer { kAdam, kLbfgs };
enum class KinLoss { kSquared, kMeanNorm };                  // sum of squares over pairs, 1/T | PHC's mean norm
enum class ContactReduction { kFrobenius, kMean };           // printed, 1/T | 1/(T N^2)
enum class ContactBlocks { kFull, kCrossAndHuman, kCross };  // N x N | without robot-robot | robot-human only
enum class RootTranslation { kConstantOffset, kPerFrame, kFixed };
enum class RestPose {
  kZero,
  kNeutral
};  // where L_pose pulls and the search begins: q = 0 as printed | the card's neutral pose
enum class ContactKeypoints {
  kNine,
  kEleven,
  kSeven
};  // head, shoulders, elbows, wrists, hands | + hips | without hands
// Double reference | float lanes: of any processor, x86-64-v2, AVX2, AVX-512; later ones are wider.
enum class KernelKind { kAuto, kScalar, kPortable, kV2, kV3, kV4 };

struct PairOptions {
  PairMode mode = PairMode::kPaper;  // sets the options below; what is set after it changes that
  PairWeights weights;
  PairSchedule schedule;
  KinLoss kin_loss = KinLoss::kSquared;
  ContactReduction contact_reduction = ContactReduction::kFrobenius;
  ContactBlocks contact_blocks = ContactBlocks::kFull;
  RootTranslation root_translation = RootTranslation::kConstantOffset;
  ContactKeypoints keypoints = ContactKeypoints::kNine;
  std::vector<ContactKeypoint> keypoint_list = {};  // where not empty, these in the place of `keypoints`
  bool filter = true;       // Gaussian, kernel 5, sigma 0.75, replicate padding, once at the end
  bool adapt_human = true;  // false keeps the partner as it is
  KernelKind kernel = KernelKind::kAuto;
  Optimizer optimizer = Optimizer::kAdam;
  int lbfgs_iterations = 50;      // the first eight with the weights of stage 1, the others with those of stage 2
  double lbfgs_tolerance = 2e-5;  // relative decrease; three steps in a row below it end the search
  // The robot stands: soles where the person's feet do, a base that follows slowly and upright
  // (retarget/ground_plan.h).
  bool ground = false;
  double root_smoothing = 0.2;  // standard deviation of the base's smoothing, where `ground` is on [s]
  double step_speed = 1.2;      // at most, mean over a step of a foot, where `ground` is on [m/s]
  RestPose rest_pose = RestPose::kZero;
  double contact_range = 0.0;  // robot-human distances count fully up to half of it and not at all beyond; 0: all [m]
  bool joint_speeds = false;   // no joint of the result is quicker than its limit (retarget/solver/pair.h)
  std::string smpl_path;       // SMPL shape basis (NPZ); empty: bone-length scaling of Table S7
};

// One table of them, for `duet list`, suites and the reference page.
const FieldTable<PairOptions>& pair_option_table();

// Text forms for the command line and for PairedMotion::settings. The setter throws std::invalid_argument for an
// unknown name or value and lists the known ones ("pair option 'root' has no value 'free': constant-offset, per-frame,
// fixed").
std::vector<std::string> pair_option_names();
void set_pair_option(PairOptions& options, const std::string& name, const std::string& value);
std::string pair_option(const PairOptions& options, const std::string& name);

// The options of a mode as it is shipped.
PairOptions pair_options_of(PairMode mode);

// Options from names and values in any order: `mode`, where it is among them, comes first.
PairOptions make_pair_options(const std::vector<std::pair<std::string, std::string>>& choices);

// Throws std::invalid_argument naming the option: a number that is negative or not finite, no iteration at all.
void validate(const PairOptions& options);

}  // namespace duet
