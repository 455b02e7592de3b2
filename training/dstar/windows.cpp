#include "duet/training/dstar/windows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/policies/language.h"

namespace duet {
namespace {

constexpr int kStatisticsWindows = 4000;
constexpr float kLeastWindowDeviation = 0.01F;

// Where a tracker has joints and a body model does not, for as long as it looks: deviations of a joint against the one
// that carries it, level and upright, found on the waiting people of SBU beside their synthetic twins. Its legs swing
// about, its neck is a shoulder's height; elbows and hands of people who wait are before them. [m]
struct Misplaced {
  SmplJoint joint;
  double level, upright;
};
constexpr std::array<Misplaced, 15> kMisplaced = {{{kLeftKnee, 0.08, 0.03},
                                                   {kRightKnee, 0.08, 0.03},
                                                   {kLeftAnkle, 0.12, 0.06},
                                                   {kRightAnkle, 0.12, 0.06},
                                                   {kLeftToe, 0.03, 0.02},
                                                   {kRightToe, 0.03, 0.02},
                                                   {kSpine1, 0.01, 0.02},
                                                   {kSpine2, 0.01, 0.03},
                                                   {kSpine3, 0.01, 0.04},
                                                   {kNeck, 0.03, 0.06},
                                                   {kHead, 0.03, 0.06},
                                                   {kLeftCollar, 0.01, 0.02},
                                                   {kRightCollar, 0.01, 0.02},
                                                   {kLeftShoulder, 0.03, 0.03},
                                                   {kRightShoulder, 0.03, 0.03}}};
constexpr std::array<Misplaced, 6> kMisplacedWaiting = {{{kLeftElbow, 0.08, 0.05},
                                                         {kRightElbow, 0.08, 0.05},
                                                         {kLeftWrist, 0.08, 0.09},
                                                         {kRightWrist, 0.08, 0.09},
                                                         {kLeftHand, 0.04, 0.04},
                                                         {kRightHand, 0.04, 0.04}}};
constexpr int kArmsSettle = 25;  // frames of the act until the hands are where they are

using Offsets = Eigen::Matrix<double, 3, kSmplJoints>;

// Parents first, so that what is carried goes along.
void add_offsets(std::span<const Misplaced> joints, double scale, Random& random, Offsets& offsets) {
  for (const Misplaced& it : joints) {
    offsets.col(it.joint) = offsets.col(kSmplParents[it.joint]);
    for (int axis = 0; axis < 3; ++axis)
      offsets(axis, it.joint) += scale * (axis == 2 ? it.upright : it.level) * random.normal();
  }
}

int clamped(const Demonstration& entry, int frame) { return entry.begin + std::clamp(frame, 0, entry.frames - 1); }

// Moves a state about a point on the ground.
void move(RobotState& state, const Eigen::Vector3d& centre, const Eigen::Vector3d& shift,
          const Eigen::Quaterniond& turn) {
  state.X_WB.p = centre + turn * (state.X_WB.p - centre) + shift;
  state.X_WB.R = turn * state.X_WB.R;
  state.v_WB = turn * state.v_WB;
}

// Not further from `centre` than `distance`, level.
void bound(Eigen::Vector3d& p, const Eigen::Vector3d& centre, double distance) {
  const Eigen::Vector2d away = (p - centre).head<2>();
  if (away.norm() > distance) p.head<2>() = centre.head<2>() + distance / away.norm() * away;
}

// Not turned from `heading` by more than `angle`; keeps its tilt.
void bound(Eigen::Quaterniond& R, double heading, double angle) {
  const double turn = std::remainder(yaw_of(R) - heading, 2.0 * EIGEN_PI);
  if (std::abs(turn) > angle) R = yaw_rotation(std::copysign(angle, turn) - turn) * R;
}

}  // namespace

std::vector<std::string> commands_of(Task task, bool leads) {
  std::vector<std::string> commands = {std::string(task_prompt(task))};
  for (const std::string_view text : task_paraphrases(task)) commands.emplace_back(text);
  const std::size_t answering = commands.size();
  for (std::size_t i = 0; leads && i < answering; ++i) commands.push_back(leading_prompt(commands[i]));
  return commands;
}

std::vector<int> loss_frames(const RobotModel& robot) {
  std::vector<int> frames;
  for (const int joint : loss_joints()) {
    const auto found = std::find_if(robot.keypoints.begin(), robot.keypoints.end(),
                                    [&](const Keypoint& keypoint) { return keypoint.smpl == joint; });
    if (found == robot.keypoints.end())
      throw std::invalid_argument("robot '" + robot.name + "' has no keypoint for '" + std::string(kSmplNames[joint]) +
                                  "', which the losses need");
    frames.push_back(found->frame);
  }
  return frames;
}

const std::array<int, kLossPoints>& loss_joints() {
  static constexpr std::array<int, kLossPoints> joints = {kHead,       kLeftShoulder, kRightShoulder, kLeftElbow,
                                                          kRightElbow, kLeftHand,     kRightHand};
  return joints;
}

void WindowBatch::resize(int windows) {
  size = windows;
  frames.resize(kFrameSize * kHistoryFrames, windows);
  past.resize(kFrameSize * kHistoryFrames, windows);
  position.resize(kPositionSize, windows);
  distance.resize(kRelations, windows);
  orientation.resize(kOrientationSize, windows);
  plan.resize(kPlanSize, windows);
  partner.resize(kAnchors * kLossPoints * 3, windows);
  phase.assign(windows, 0);
  task.assign(windows, 0);
  prompt.assign(windows, 0);
}

std::vector<Window> list_windows(const DemonstrationSet& set, const WindowOptions& options) {
  std::vector<Window> windows;
  for (std::size_t i = 0; i < set.list.size(); ++i)
    for (int frame = 0; frame < set.list[i].frames; frame += options.stride)
      windows.push_back({static_cast<int>(i), frame});
  return windows;
}

WindowMaker::WindowMaker(std::shared_ptr<const RobotModel> robot, const DemonstrationSet& set,
                         const WindowOptions& options)
    : robot_(std::move(robot)), set_(set), options_(options), features_(robot_) {}

void WindowMaker::look(const Demonstration& entry, int frame, Random& random) {
  const auto seen = [&](int before) {
    const int column = clamped(entry, frame - before);
    return ObservationFrame{set_.partner.col(column).cast<double>().reshaped(3, kSmplJoints), set_.state(column)};
  };
  for (int i = 0; i < kHistoryFrames; ++i) {
    history_[i] = seen(kHistoryFrames - 1 - i);
    past_[i] = seen((kHistoryFrames - 1 - i) * options_.long_stride);
  }
  if (!options_.augment) return;
  misplace(entry, frame, random);
  blur(random);
  displace(random);
}

// The partner as another tracker has people: each joint beside its place in all frames, arms until the act has begun.
// Nothing of it may tell that the act is about to begin, so that arms come to their places after it.
void WindowMaker::misplace(const Demonstration& entry, int frame, Random& random) {
  if (!random.chance(2.0 / 3.0)) return;
  const double scale = random.uniform(0.0, options_.misplaced);
  Offsets always = Offsets::Zero(), waiting = Offsets::Zero();
  add_offsets(kMisplaced, scale, random, always);
  add_offsets(kMisplacedWaiting, scale, random, waiting);
  const auto put = [&](ObservationFrame& seen, int at) {
    const double share =
        entry.leads ? 1.0 : std::clamp(1.0 - static_cast<double>(at - entry.phases.act_begin) / kArmsSettle, 0.0, 1.0);
    seen.partner += always + share * waiting;
  };
  for (int i = 0; i < kHistoryFrames; ++i) {
    put(history_[i], frame - (kHistoryFrames - 1 - i));
    put(past_[i], frame - (kHistoryFrames - 1 - i) * options_.long_stride);
  }
}

// The partner through a camera: joints that jitter, joints that keep their last place.
void WindowMaker::blur(Random& random) {
  const double sigma = random.chance(0.5) ? random.uniform(0.0, options_.jitter) : 0.0;
  const double lost = random.chance(1.0 / 3.0) ? random.uniform(0.0, options_.dropout) : 0.0;
  const auto jitter = [&](Eigen::Ref<Eigen::Vector3d> place) {
    if (sigma > 0.0) place += sigma * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  };
  for (int i = 0; i < kHistoryFrames; ++i) {
    for (int joint = 0; joint < kSmplJoints; ++joint) {
      auto place = history_[i].partner.col(joint);
      jitter(place);
      if (lost > 0.0 && i > 0 && random.chance(lost)) place = history_[i - 1].partner.col(joint);
      jitter(past_[i].partner.col(joint));
    }
  }
}

// The robot beside the place and the posture that it is meant to have.
void WindowMaker::displace(Random& random) {
  const Eigen::Vector3d centre = history_.back().robot.X_WB.p;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double angle = 0.0;
  Eigen::Quaterniond lean = Eigen::Quaterniond::Identity();
  if (random.chance(2.0 / 3.0)) {
    shift = options_.root * Eigen::Vector3d(random.normal(), random.normal(), 0.1 * random.normal());
    angle = options_.heading * random.normal();
    lean = Eigen::AngleAxisd(options_.tilt * random.normal(), Eigen::Vector3d::UnitX()) *
           Eigen::AngleAxisd(options_.tilt * random.normal(), Eigen::Vector3d::UnitY());
  }
  if (random.chance(0.25)) {
    const double direction = random.uniform(0.0, 2.0 * EIGEN_PI), distance = random.uniform(0.0, options_.astray);
    shift += distance * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0.0);
    angle += random.uniform(-options_.turned, options_.turned);
  }
  const Eigen::Quaterniond turn = yaw_rotation(angle);
  Eigen::VectorXd offset(robot_->dof());
  for (double& value : offset) value = options_.joints * random.normal();
  const auto disturb = [&](ObservationFrame& frame) {
    move(frame.robot, centre, shift, turn);
    frame.robot.X_WB.R = frame.robot.X_WB.R * lean;
    frame.robot.q += offset;
    for (int i = 0; i < robot_->dof(); ++i) {
      frame.robot.q[i] += 0.2 * options_.joints * random.normal();
      frame.robot.v[i] += options_.rates * random.normal();
    }
    for (int axis = 0; axis < 3; ++axis) {
      frame.robot.v_WB[axis] += options_.root * random.normal();
      frame.robot.w_WB_B[axis] += options_.heading * random.normal();
    }
  };
  std::ranges::for_each(history_, disturb);
  std::ranges::for_each(past_, disturb);
  past_.back() = history_.back();
}

void WindowMaker::make(const Window& window, Random& random, WindowBatch& batch, int column) {
  const Demonstration& entry = set_.list[window.demonstration];
  const int frame = std::min(entry.frames - 1, window.frame + (options_.augment ? random.below(options_.stride) : 0));
  look(entry, frame, random);
  features_.make({history_, frame}, past_, made_);
  batch.frames.col(column) = made_.frames.reshaped();
  batch.past.col(column) = made_.past.reshaped();
  batch.position.col(column) = made_.position;
  batch.distance.col(column) = made_.distance;
  batch.orientation.col(column) = made_.orientation;

  const Pose X_WE = ego_frame(history_.back().robot), X_EW = X_WE.inverse();
  const double heading = yaw_of(X_WE.R);
  Anchors anchors;
  for (int k = 0; k < kAnchors; ++k) {
    const int then = clamped(entry, frame + k * kTicksPerAnchor);
    anchors[k] = set_.reference(then);
    const double seconds = kAnchorSpacing * k;
    bound(anchors[k].X_WB.p, X_WE.p, options_.reach + options_.speed * seconds);
    bound(anchors[k].X_WB.R, heading, options_.turn_reach + options_.turn_rate * seconds);
    for (int point = 0; point < kLossPoints; ++point) {
      const Eigen::Vector3d p_W = set_.partner.col(then).segment<3>(3 * loss_joints()[point]).cast<double>();
      batch.partner.col(column).segment<3>(3 * (kLossPoints * k + point)) = (X_EW * p_W).cast<float>();
    }
  }
  encode_plan(anchors, X_WE, *robot_, {batch.plan.col(column).data(), kPlanSize});
  batch.phase[column] = static_cast<int>(entry.phases.at(frame));
  batch.task[column] = entry.task.index();
  const int paraphrases = static_cast<int>(task_paraphrases(entry.task).size());
  batch.prompt[column] = options_.augment && random.chance(0.5) ? 1 + random.below(paraphrases) : 0;
  if (entry.leads) batch.prompt[column] += 1 + paraphrases;
}

void draw_windows(WindowMaker& maker, const std::vector<Window>& windows, Random& random, WindowBatch& batch) {
  for (int i = 0; i < batch.size; ++i)
    maker.make(windows[random.below(static_cast<int>(windows.size()))], random, batch, i);
}

DstarFeatures features_of(const WindowBatch& batch, int column) {
  DstarFeatures features;
  features.frames = batch.frames.col(column).reshaped(kFrameSize, kHistoryFrames);
  features.past = batch.past.col(column).reshaped(kFrameSize, kHistoryFrames);
  features.position = batch.position.col(column);
  features.distance = batch.distance.col(column);
  features.orientation = batch.orientation.col(column);
  return features;
}

WindowStatistics window_statistics(WindowMaker& maker, const std::vector<Window>& windows, std::uint64_t seed) {
  Random random(seed, stream_key({"window statistics"}));
  WindowBatch batch;
  batch.resize(kStatisticsWindows);
  draw_windows(maker, windows, random, batch);
  Eigen::MatrixXf frames(kFrameSize, 2 * Eigen::Index{kHistoryFrames} * kStatisticsWindows);
  frames << batch.frames.reshaped(kFrameSize, frames.cols() / 2), batch.past.reshaped(kFrameSize, frames.cols() / 2);
  WindowStatistics statistics;
  statistics.frame_mean = frames.rowwise().mean();
  statistics.frame_deviation =
      (frames.colwise() - statistics.frame_mean).rowwise().norm() / std::sqrt(static_cast<float>(frames.cols()));
  statistics.plan_mean = batch.plan.rowwise().mean();
  statistics.plan_deviation = (batch.plan.colwise() - statistics.plan_mean).rowwise().norm() /
                              std::sqrt(static_cast<float>(kStatisticsWindows));
  statistics.frame_deviation = statistics.frame_deviation.cwiseMax(kLeastWindowDeviation);
  statistics.plan_deviation = statistics.plan_deviation.cwiseMax(kLeastWindowDeviation);
  return statistics;
}

namespace {

void normalise(RetrievalLibrary& library) {
  library.mean = library.keys.rowwise().mean();
  library.keys.colwise() -= library.mean;
  library.deviation =
      (library.keys.rowwise().norm() / std::sqrt(static_cast<float>(library.windows()))).cwiseMax(0.01F);
  library.keys = library.keys.array().colwise() / library.deviation.array();
}

}  // namespace

RetrievalLibrary make_retrieval_library(const std::shared_ptr<const RobotModel>& robot, const DemonstrationSet& set,
                                        int windows, std::uint64_t seed) {
  const WindowOptions options{.augment = false};
  const std::vector<Window> all = list_windows(set, options);
  require(!all.empty(), "a library of demonstrations without a window");
  WindowMaker maker(robot, set, options);
  Random random(seed, stream_key({"retrieval"}));
  WindowBatch batch;
  batch.resize(windows);
  draw_windows(maker, all, random, batch);
  RetrievalLibrary library{robot->name, robot->joint_names(), batch.task, {}, {}, {}, batch.plan};
  library.keys.resize(kRetrievalKey, windows);
  for (int i = 0; i < windows; ++i) write_key(features_of(batch, i), library.keys.col(i));
  normalise(library);
  return library;
}

}  // namespace duet
